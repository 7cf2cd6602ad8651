"""Processes that are watched: what they tell, how their end is read, and that nothing of them stays."""

from __future__ import annotations

import os
import signal
import time

import psutil
import pytest

from gibench.processes import ChildProcess, ProcessEnded, TookTooLong


def tell(connection, *words):
    for word in words:
        connection.send(word)


def end(connection, code):
    connection.send("here")
    os._exit(code)


def die(connection, number):
    connection.send("here")
    os.kill(os.getpid(), number)


def echo(connection):
    connection.send("here")
    while True:
        connection.send(connection.recv())


def hang(connection):
    connection.send("here")
    time.sleep(600)


def test_all_that_it_told_is_heard_before_its_end():
    with ChildProcess(tell, "one", ("two", 2)) as process:
        assert [process.receive(), process.receive()] == ["one", ("two", 2)]
        with pytest.raises(ProcessEnded, match="its process ended with code 0"):
            process.receive()


@pytest.mark.parametrize(
    ("body", "argument", "code", "how"),
    [
        (end, 7, 7, "ended with code 7"),
        (die, signal.SIGKILL, -signal.SIGKILL, "killed by SIGKILL"),
        (die, signal.SIGRTMIN + 5, -(signal.SIGRTMIN + 5), f"killed by signal {signal.SIGRTMIN + 5}"),
    ]
    if hasattr(signal, "SIGRTMIN")
    else [(end, 7, 7, "ended with code 7")],
)
def test_its_end_is_read(body, argument, code, how):
    with ChildProcess(body, argument) as process:
        assert process.receive() == "here"
        with pytest.raises(ProcessEnded) as ended:
            process.receive()
    assert (ended.value.code, ended.value.how) == (code, how)


def test_silence_ends_the_patience_of_who_waits():
    looks = []
    with ChildProcess(hang) as process:
        assert process.receive(600) == "here"
        with pytest.raises(TookTooLong, match="it took more than 0 s"):
            process.receive(0.0, lambda: looks.append(process.alive))
        assert looks == [True]

        def given_up():
            raise KeyError("nobody wants it")

        with pytest.raises(KeyError):
            process.receive(600, given_up)
    assert not process.alive


@pytest.mark.skipif(not hasattr(signal, "SIGSTOP"), reason="needs signals")
def test_one_that_was_stopped_is_gone_too():
    with ChildProcess(hang) as process:
        process.receive()
        os.kill(process.pid, signal.SIGSTOP)
    assert not process.alive
    assert not psutil.pid_exists(process.pid)


@pytest.mark.skipif(os.name != "posix", reason="needs signals")
def test_what_asks_to_end_is_left_to_the_parent():
    """Ctrl-C reaches all processes of a command at once."""
    with ChildProcess(echo) as process:
        process.receive()
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            os.kill(process.pid, number)
        process.connection.send("still there")
        assert process.receive() == "still there"
