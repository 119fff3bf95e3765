# SPDX-License-Identifier: BSD-3-Clause
"""No log has a token in it. Every user of the machine can read ROS's log files, and whoever has a token may move the
robot: roslaunch logs its environment, its arguments and all parameters, tornado the address of a request that fails.
"""
import functools
import logging
import re

# A token in a text: in an address, a header, a parameter, an argument, an environment.
_TOKEN = re.compile(r"""((?:token["']?[ ]*[=:]=?[ ]*\[?b?["']?|--(?:view-)?token |\bbearer\s+))[^\s&;"'<>,)\]]+""",
                    re.IGNORECASE)
_TRACEBACKS = logging.Formatter()


def hidden(text: str) -> str:
    """A text with "…" in the place of each token."""
    return _TOKEN.sub(r"\1…", text)


def hide_in_logs() -> None:
    """From now on no record of this process's logs has a token in it."""
    make = logging.getLogRecordFactory()
    if getattr(make, "hides_tokens", False):
        return

    def made(*args, **kwargs):
        record = make(*args, **kwargs)
        try:
            said = record.getMessage()
        # Its arguments do not fit its text, or cannot be shown; its handler says so.
        except Exception:
            return record
        if (clean := hidden(said)) != said:
            record.msg, record.args = clean, ()
        if record.exc_info and record.exc_info[0] is not None:
            traceback = _TRACEBACKS.formatException(record.exc_info)
            if (clean := hidden(traceback)) != traceback:
                # Handlers write this in place of their own text.
                record.exc_text = clean
        return record

    made.hides_tokens = True
    logging.setLogRecordFactory(made)


def amend(config) -> None:
    """Called when roslaunch.config, which writes a summary of the parameters, has been loaded: before roslaunch logs.
    Other programs' logs are their own: a text with "token:" in it is what they mean.
    """
    hide_in_logs()
    summary = config.ROSLaunchConfig.summary

    @functools.wraps(summary)
    def without_tokens(*args, **kwargs):
        return hidden(summary(*args, **kwargs))

    config.ROSLaunchConfig.summary = without_tokens
