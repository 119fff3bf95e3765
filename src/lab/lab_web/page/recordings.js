// SPDX-License-Identifier: BSD-3-Clause
// The lab's recording: one for all pages, in the format of joint_recorder.
import {text} from "./texts.js";

const byId = (name) => document.getElementById(name);

export class Recordings {
  // send(operation); query: the page's token as a query; page(): the page's number; note(code, detail).
  constructor(send, query, page, note) {
    this.state = {running: false, seconds: null};
    this.acting = this.driving = false;
    byId("record").onclick = () => send({op: "record", on: !this.state.running});
    byId("play").onclick = () => send({op: "play"});
    byId("recording-save").href = `recording.csv${query}`;
    const file = byId("recording-file");
    byId("recording-load").onclick = () => file.click();
    file.onchange = async () => {
      if (!file.files.length) return;
      const answer = await fetch(`recording${query}&page=${page()}`, {method: "POST", body: file.files[0]});
      if (!answer.ok) note("refused", `${answer.status}`);
      file.value = "";
    };
  }

  show(state) {
    this.state = state;
    this.refresh();
  }

  allow(acting, driving) {
    Object.assign(this, {acting, driving});
    this.refresh();
  }

  refresh() {
    const {running, seconds} = this.state;
    byId("record").textContent = text(running ? "record_end" : "record");
    byId("record").setAttribute("aria-pressed", running);
    byId("record").disabled = byId("recording-load").disabled = !this.acting;
    byId("play").disabled = !this.driving || running || seconds === null;
    byId("recording-save").hidden = seconds === null;
    byId("recording-state").textContent = running ? text("recording_runs")
      : seconds === null ? text("recording_none") : text("recording_kept", {seconds: seconds.toFixed(1)});
  }
}
