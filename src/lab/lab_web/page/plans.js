// SPDX-License-Identifier: BSD-3-Clause
// Poses and hands around obstacles: the server has a path planned where a move_group runs, and says how that went.
import {has, text} from "./texts.js";

const byId = (name) => document.getElementById(name);

export class Plans {
  constructor() {
    Object.assign(this, {canPlan: false, last: null});
  }

  build({can_plan: canPlan = false}) {
    this.canPlan = canPlan;
    byId("plans").hidden = !canPlan;
    this.refresh();
  }

  // A motion to a pose or to joints, or the same with a plan.
  choose(motion) {
    this.last = null;
    this.refresh();
    return this.canPlan && byId("plan-first").checked ? {...motion, op: "plan"} : motion;
  }

  // What the server says of the planning; null: something else has ended it, or the motion.
  answered(answer) {
    this.last = answer;
    this.refresh();
  }

  refresh() {
    const {why, text: detail, seconds} = this.last ?? {};
    const key = has(`plan_${why}`) ? `plan_${why}` : has(why) ? why : "plan_other";
    byId("plan-said").textContent = why === undefined ? "" : text(key, {text: detail, seconds});
    byId("plan-said").classList.toggle("bad", !["busy", "found", "already_there", undefined].includes(why));
  }
}
