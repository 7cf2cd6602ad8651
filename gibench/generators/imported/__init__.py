"""Imported scenes: Mitsuba XML of any age, brought to Z-up metres, with cameras like those of a generated room."""
