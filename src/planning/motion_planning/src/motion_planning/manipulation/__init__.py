# SPDX-License-Identifier: BSD-3-Clause
"""Pick and place: selects a valid grasp or place from many candidates, and plans the arm's motion."""
from motion_planning.manipulation.places import places_on
from motion_planning.manipulation.planning import (
           Fall,
           Manipulation,
           ManipulationFailure,
           ManipulationTools,
           plan_manipulation,
)
from motion_planning.manipulation.tasks import (
           Candidate,
           ManipulationStage,
           PickTask,
           PlaceTask,
           Translation,
           hand_links,
)

__all__ = ["Candidate", "Fall", "Manipulation", "ManipulationFailure", "PickTask", "PlaceTask", "ManipulationStage",
           "ManipulationTools", "Translation", "hand_links", "places_on", "plan_manipulation"]
