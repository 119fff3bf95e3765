# SPDX-License-Identifier: BSD-3-Clause
"""New addresses for students who have lost theirs, or whose has become known."""
from types import SimpleNamespace

from lab_class import front_door
from lab_class.labs import Action, ClassLabState, Labs, Role
from lab_class.store import ClassOptions, ClassRecord
from lab_class.supervisor import Supervisor
from rf_checks import roster


def test_new_tokens_end_what_the_old_ones_opened():
    record = ClassRecord.made(ClassOptions(), [roster.Student("anna", "Anna"), roster.Student("ben", "Ben")])
    written, done = [], []
    labs = Labs(["anna", "ben"], 2, None)
    labs["anna"].state = ClassLabState.RUNNING
    found = SimpleNamespace(_record=record, labs=labs, _now=lambda: 0.0, _do=done.extend,
                            _store=SimpleNamespace(write=written.append))
    found.door = front_door.FrontDoor(record, found)
    found.renew = lambda name: Supervisor.renew(found, name)
    old = record.tokens["anna"].act
    found.renew("anna")
    new = found.door.record.tokens["anna"].act
    assert written == [found.door.record] and new != old
    assert found.door.role("anna", [old]) is None and found.door.role("anna", [new]) is Role.STUDENT
    # The lab itself still knows the old ones, and pages are open.
    assert done == [(Action.END, "anna")] and labs["anna"].state is ClassLabState.WAITING
    found.renew("ben")
    found.renew("instructor")
    assert len(done) == 1 and found.door.is_instructor(found.door.record.instructor)
    assert not found.door.is_instructor(record.instructor)
