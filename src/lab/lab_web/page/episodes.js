// SPDX-License-Identifier: BSD-3-Clause
// Demonstrations: recorded episode by episode into a data set, with a strip of pictures of each.
import {element} from "./panel.js";
import {text} from "./texts.js";

const MARKS = ["success", "failure", "again"];
const CAMERAS = ["head", "left_hand", "right_hand"];
// Sentences that demonstrations of gym_baxter have, and others like them.
const TASKS = ["Pick up the block.", "Put the block onto the mark on the table.", "Lift the pot by both handles.",
  "Give the hammer from the right hand to the left one."];
// A second click within this time deletes.
const SURE_MS = 4000;

const byId = (name) => document.getElementById(name);

export class Episodes {
  // send(operation); query: the page's token as a query.
  constructor(send, query) {
    this.send = (what) => send({op: "episodes", ...what});
    this.query = query;
    this.state = {running: false, recording: false, bad: false, said: "", folder: "", version: 0, episodes: [], camera: "", rate: 0};
    this.acting = false;
    this.tasks = [...TASKS];
    byId("episode-record").onclick = () => this.send(this.state.running ? {do: "stop"}
      : {do: "start", task: byId("episode-task").value, camera: byId("episode-camera").value});
    for (const mark of MARKS) byId(`episode-${mark}`).onclick = () => this.send({do: mark});
    // Not a field to type in: the space bar stops the robot, everywhere on the page.
    byId("episode-task").onchange = ({target}) => {
      if (target.value) return;
      const words = prompt(text("episode_task"))?.trim();
      if (words) this.tasks.unshift(words);
      this.build();
    };
    byId("episodes-save").href = `episodes.zip${query}`;
  }

  // The lists, in the language of now.
  build() {
    const task = byId("episode-task").value;
    const option = (value, words) => element("option", {value, textContent: words});
    byId("episode-task").replaceChildren(...this.tasks.map((one) => option(one, one)), option("", text("episode_other")));
    if (this.tasks.includes(task)) byId("episode-task").value = task;
    const camera = byId("episode-camera").value;
    byId("episode-camera").replaceChildren(option("", text("camera_off")), ...CAMERAS.map((one) => option(one, one)));
    byId("episode-camera").value = camera;
    this.refresh();
  }

  show(state) {
    const isNew = state.version !== this.state.version;
    this.state = state;
    if (isNew) this.list();
    this.refresh();
  }

  allow(acting) {
    this.acting = acting;
    this.refresh();
  }

  refresh() {
    const {running, recording, bad, said, episodes, camera, folder} = this.state;
    byId("episode-record").textContent = text(running ? "episode_stop" : "episode_record");
    byId("episode-record").setAttribute("aria-pressed", running);
    byId("episode-record").disabled = !this.acting;
    for (const mark of MARKS) {
      byId(`episode-${mark}`).textContent = text(`steer_${mark}`);
      byId(`episode-${mark}`).disabled = !this.acting || !recording;
    }
    byId("episode-task").disabled = !this.acting || running;
    byId("episode-camera").disabled = !this.acting || running || episodes.length > 0;
    byId("episode-camera").title = episodes.length ? text("episode_camera_kept") : "";
    if (episodes.length) byId("episode-camera").value = camera.replace("observation.images.", "");
    byId("episode-said").classList.toggle("bad", bad);
    byId("episode-said").textContent = said || (running ? text("episode_starts") : "");
    byId("episodes-kept").textContent = text(episodes.length ? "episodes_kept" : "episodes_none", {count: episodes.length, folder});
    byId("episodes-save").hidden = episodes.length === 0;
    for (const button of document.querySelectorAll("#episode-list button")) {
      button.disabled = !this.acting || running;
      button.title = running ? text("episode_delete_later") : "";
      button.textContent = text(button.dataset.sure ? "episode_sure" : "delete");
    }
  }

  list() {
    const {episodes, camera, rate, version} = this.state;
    byId("episode-list").replaceChildren(...[...episodes].reverse().map(({number, frames, success}) => element("li", {},
      element("span", {className: success ? "good" : "bad", textContent: `${number}: ${text(success ? "steer_success" : "steer_failure")}`}),
      element("span", {className: "faint", textContent: rate ? `${(frames / rate).toFixed(1)} s` : ""}),
      element("button", {className: "plain small", textContent: text("delete"), onclick: ({target}) => this.delete(number, version, target)}),
      ...camera ? [element("img", {alt: text("episode_strip", {number}), loading: "lazy",
        src: `episodes/${number}.jpg${this.query}&version=${version}`})] : [])));
  }

  delete(number, version, button) {
    if (button.dataset.sure) this.send({do: "delete", number, version});
    else {
      button.dataset.sure = "yes";
      button.textContent = text("episode_sure");
      setTimeout(() => {
        delete button.dataset.sure;
        button.textContent = text("delete");
      }, SURE_MS);
    }
  }
}
