import multiprocessing
import pickle

import pytest

from gibench.baselines.booking import Booking


def test_what_is_booked():
    booking = Booking(4)
    assert booking.booked == []
    booking.book(2)
    booking.book(0)
    booking.book(2)
    assert booking.booked == [0, 2]
    booking.book_all()
    assert booking.booked == [0, 1, 2, 3]
    nothing = Booking(0)
    nothing.book_all()
    assert nothing.booked == []


@pytest.mark.skipif("fork" not in multiprocessing.get_all_start_methods(), reason="this system does not fork")
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_a_forked_process_books_for_all():
    booking = Booking(3)
    child = multiprocessing.get_context("fork").Process(target=booking.book, args=(1,))
    child.start()
    child.join()
    assert booking.booked == [1]


def test_sending_it_away_books_all():
    booking = Booking(3)
    assert pickle.loads(pickle.dumps(booking)).booked == []
    assert booking.booked == [0, 1, 2]
