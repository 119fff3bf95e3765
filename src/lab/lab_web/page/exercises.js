// SPDX-License-Identifier: BSD-3-Clause
// The result of the exercise that was checked last, beside the robot.
import {element} from "./panel.js";
import {text} from "./texts.js";

const byId = (name) => document.getElementById(name);
const rounded = (points) => String(Math.round(points * 10) / 10);

export class Exercises {
  constructor() {
    this.result = null;
  }

  show(result) {
    this.result = result;
    this.refresh();
  }

  refresh() {
    if (!this.result) return;
    const {exercise: name, passed, points, due, why, hint, runs} = this.result;
    byId("exercise").hidden = false;
    byId("exercise-verdict").textContent = points === null ? text("exercise_not_graded", {name, text: why})
      : text(passed ? "exercise_passed" : "exercise_not_passed", {name, points: rounded(points), due: rounded(due)});
    byId("exercise-verdict").classList.toggle("bad", !passed);
    byId("exercise-hint").textContent = hint && text("exercise_hint", {text: hint});
    byId("exercise-runs").replaceChildren(...runs.flatMap(({call, criteria}) => [
      element("tr", {}, element("th", {colSpan: 3, textContent: `${name} ${call}`})),
      ...criteria.map((one) => element("tr", {}, element("td", {textContent: one.name}),
        element("td", {textContent: `${rounded(one.points)} / ${rounded(one.of)}`}),
        element("td", {textContent: one.found})))]));
  }
}
