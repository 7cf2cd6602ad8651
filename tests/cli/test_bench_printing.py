from gibench.benchmarks.scoring import Scored
from gibench.cli.bench_printing import print_scored


def test_what_scoring_leaves_out_is_said_once_for_each_reason_within_80_columns(capsys):
    why = "there is no sequence of two frames or more"
    names = ("warping_error", "temporal_difference", "mabd")
    print_scored(Scored(9, dict.fromkeys(names, (why, 7)), ("two problems",), {"mse": 3, "psnr": 2}))
    said = capsys.readouterr()
    lines = said.out.splitlines()
    assert max(map(len, lines)) <= 80
    text = " ".join(said.out.split())
    assert text == (
        f"left out warping_error, temporal_difference, mabd of 7 results: {why} noise estimates below 0, as those of "
        "good images may be, stand as no error: mse (3), psnr (2)"
    )
    assert said.err == "two problems\n"
