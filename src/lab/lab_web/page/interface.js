// SPDX-License-Identifier: BSD-3-Clause
// How much of a physical robot's interface is here: compared when somebody asks, the same for all pages.
import {element} from "./panel.js";
import {text} from "./texts.js";

const byId = (name) => document.getElementById(name);

export class Interface {
  // send(operation).
  constructor(send) {
    Object.assign(this, {state: {}, allowed: false});
    byId("interface-compare").onclick = () => send({op: "compare"});
  }

  show(state) {
    this.state = state;
    this.refresh();
  }

  allow(allowed) {
    this.allowed = allowed;
    this.refresh();
  }

  refresh() {
    const {is_running: isRunning = false, met, of, groups = [], others = [], when_s: when} = this.state;
    byId("interface-compare").disabled = !this.allowed || isRunning;
    byId("interface-said").textContent = isRunning ? text("comparing")
      : when ? text("interface_score", {met, of, when: new Date(when * 1000).toLocaleString(document.documentElement.lang)})
        : text("not_compared");
    byId("interface-groups").replaceChildren(...groups.map(({name, met: here, of: due}) => element("tr", {},
      element("th", {scope: "row", textContent: name}), element("td", {textContent: `${here} / ${due}`}))));
    byId("interface-others").replaceChildren(...others.map(({name, verdict, reason}) => element("li", {},
      element("b", {textContent: name}), ` ${text(`interface_${verdict}`)}: ${reason}`)));
  }
}
