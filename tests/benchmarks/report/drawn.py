"""What is seen of a figure."""

from gibench.benchmarks.report.labels import Box


def boxes(figure):
    """The texts of a figure that are seen, with the places that they take."""
    renderer = figure.canvas.get_renderer()
    figure.draw(renderer)
    texts = list(figure.texts)
    for axes in figure.axes:
        texts += [*axes.texts, axes.xaxis.label, axes.yaxis.label, axes.title, axes._left_title]
        for axis in (axes.xaxis, axes.yaxis):
            low, high = sorted(axis.get_view_interval())
            texts += [tick.label1 for tick in axis.get_major_ticks() if low <= tick.get_loc() <= high]
    return [
        (text.get_text(), Box(*text.get_window_extent(renderer).extents))
        for text in texts
        if text.get_visible() and text.get_text().strip()
    ]
