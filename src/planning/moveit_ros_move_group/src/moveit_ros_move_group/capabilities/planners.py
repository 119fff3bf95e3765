# SPDX-License-Identifier: BSD-3-Clause
"""query_planner_interface, get_planner_params, set_planner_params."""
from __future__ import annotations

from typing import TYPE_CHECKING

import rospy
from moveit_msgs.msg import PlannerInterfaceDescription
from moveit_msgs.srv import (
    GetPlannerParams,
    GetPlannerParamsResponse,
    QueryPlannerInterfaces,
    QueryPlannerInterfacesResponse,
    SetPlannerParams,
    SetPlannerParamsResponse,
)

from moveit_ros_move_group.context import answered

if TYPE_CHECKING:
    from moveit_msgs.srv import GetPlannerParamsRequest, QueryPlannerInterfacesRequest, SetPlannerParamsRequest

    from moveit_ros_move_group.context import Context
    from moveit_ros_move_group.settings import Pipeline

_DESCRIPTIONS = {"ompl": "OMPL", "pilz_industrial_motion_planner": "Pilz Industrial Motion Planner"}


class Planners:
    """Settings of planners by pipeline, group and name; those that are set count for requests from then on."""

    def __init__(self, context: Context) -> None:
        self.context = context
        self._services = [rospy.Service("query_planner_interface", QueryPlannerInterfaces, self._query),
                          rospy.Service("get_planner_params", GetPlannerParams, self._get),
                          rospy.Service("set_planner_params", SetPlannerParams, self._set)]

    @answered("query_planner_interface", QueryPlannerInterfacesResponse)
    def _query(self, _: QueryPlannerInterfacesRequest, response: QueryPlannerInterfacesResponse) -> None:
        for name, pipeline in self.context.pipelines.items():
            response.planner_interfaces.append(PlannerInterfaceDescription(
                _DESCRIPTIONS.get(name, name), name, pipeline.planner_ids()))

    @answered("get_planner_params", GetPlannerParamsResponse)
    def _get(self, request: GetPlannerParamsRequest, response: GetPlannerParamsResponse) -> None:
        pipeline = self._pipeline(request.pipeline_id)
        params = pipeline.settings(request.group, request.planner_config) if pipeline else {}
        response.params.keys, response.params.values = list(params), list(params.values())
        response.params.descriptions = [""] * len(params)

    @answered("set_planner_params", SetPlannerParamsResponse)
    def _set(self, request: SetPlannerParamsRequest, response: SetPlannerParamsResponse) -> None:
        pipeline = self._pipeline(request.pipeline_id)
        if pipeline is None:
            rospy.logwarn("set_planner_params: there is no pipeline '%s'", request.pipeline_id)
            return
        name = "%s[%s]" % (request.group, request.planner_config) if request.group else request.planner_config
        params = {} if request.replace else dict(pipeline.planners.get(name, {}))
        params.update(zip(request.params.keys, request.params.values, strict=False))
        pipeline.planners[name] = params

    def _pipeline(self, name: str) -> Pipeline | None:
        return self.context.pipelines.get(name or self.context.default_pipeline)
