from gibench.cli.making import two_digits


def test_two_digits_have_no_exponent():
    values = (0.0, 0.0123, 1.26, 12.6, 302.5, 126_000)
    assert [two_digits(value) for value in values] == ["0", "0.012", "1.3", "13", "300", "130000"]
