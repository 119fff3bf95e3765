# SPDX-License-Identifier: BSD-3-Clause
"""Which file is the program for which exercise, and programs out of notebooks."""
import json

import pytest

from rf_checks.exercises import UnknownExercise
from rf_grading import programs

WAVE, TF = programs.exercises_of("lab2", ["wave"])[0], programs.exercises_of("lab2", ["tf_listener"])[0]
BOTH = [TF, WAVE]


def assign(files, exercises=BOTH):
    found = programs.assign({path: text.encode() for path, text in files.items()}, exercises)
    return {exercise.name: one.path if isinstance(one, programs.Program) else str(one)
            for exercise, one in found.items()}


@pytest.mark.parametrize(("files", "found"), [
    ({"my_wave.py": "", "tf_listener.py": ""}, {"wave": "my_wave.py", "tf_listener": "tf_listener.py"}),
    ({"a.py": "# exercise: wave\n", "b.py": "import rospy\ntf.lookup_transform()"},
     {"wave": "a.py", "tf_listener": "b.py"}),
    # As Windows saves it.
    ({"a.py": "\ufeff# exercise: wave\r\n"}, {"wave": "a.py", "tf_listener": "no program for tf_listener"}),
    # What another file imports is no program.
    ({"wave.py": "import wave_tools", "wave_tools.py": "x = 1"}, {"wave": "wave.py"}),
    ({"wave.py": "from lib import wave_b", "lib/wave_b.py": "x = 1"}, {"wave": "wave.py"}),
    # The same file twice is one.
    ({"wave.py": "a", "copy/wave.py": "a"}, {"wave": "copy/wave.py"}),
    ({"wave.py": "a", "new/wave.py": "b"}, {"wave": "2 different files are for wave: new/wave.py, wave.py; send one"}),
    ({"readme.py": "x = 1"}, {"wave": "no program for wave", "tf_listener": "no program for tf_listener"}),
    ({"a.py": "# exercise: ik_frame"}, {"wave": "no program for wave: a.py is marked for ik_frame"}),
    ({"a.ipynb": "{"}, {"wave": "no program for wave: a.ipynb is no notebook that can be read"}),
    ({"tf_listener.py": "# exercise: wave\n"}, {"wave": "tf_listener.py"}),
])
def test_programs_find_their_exercise(files, found):
    assert found.items() <= assign(files).items()


def test_one_file_for_one_exercise_may_have_any_name():
    assert assign({"abgabe.py": "print 'hello'"}, [WAVE]) == {"wave": "abgabe.py"}
    assert assign({"abgabe.py": "# exercise: tf_listener"}, [WAVE]) == {
        "wave": "no program for wave: abgabe.py is marked for tf_listener"}


def test_a_notebook_becomes_a_program_that_python_can_read():
    cells = [{"cell_type": "markdown", "source": ["# no code"]},
             {"cell_type": "code", "source": ["%matplotlib inline\n", "import rospy\n", "if True:\n", "    !ls\n"]},
             {"cell_type": "code", "source": ["%%bash\n", "echo hello"]},
             {"cell_type": "code", "source": ["a = '''\n", "%s\n", "''' % 3"]}]
    files = {"wave.ipynb": json.dumps({"cells": cells}).encode()}
    program = programs.assign(files, [WAVE])[WAVE]
    assert (program.path, program.note) == ("wave.py", "made of the code cells of wave.ipynb")
    found = {}
    exec(compile(program.files["wave.py"].decode().replace("import rospy", ""), "wave.py", "exec"), found)
    assert found["a"] == "\n3\n"


def test_an_exported_program_counts_instead_of_its_notebook():
    files = {"wave.ipynb": b"{}", "wave.py": b"1"}
    program = programs.assign(files, [WAVE])[WAVE]
    assert (program.files, program.note) == ({"wave.py": b"1"}, "")


def test_exercises_are_chosen_by_lab_and_name():
    assert {one.lab for one in programs.exercises_of()} == {"lab2", "cwru", "moveit", "steering"}
    for lab, names, words in (("lab7", (), "no lab 'lab7'"), ("lab2", ("wav",), "no exercise 'wav'")):
        with pytest.raises(UnknownExercise, match=words):
            programs.exercises_of(lab, names)


@pytest.mark.parametrize(("source", "words"), [
    ("print('\ud800')", "half of a surrogate pair"), ("a\n" * (1 << 20), "bytes of code")])
def test_a_notebook_that_makes_no_program_is_told(source, words):
    cells = [{"cell_type": "code", "source": [source]}]
    files, notes = programs.with_notebooks_as_programs({"wave.ipynb": json.dumps({"cells": cells}).encode()})
    assert files == {} and words in notes["wave.ipynb"]
