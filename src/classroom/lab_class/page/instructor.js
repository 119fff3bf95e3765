// SPDX-License-Identifier: BSD-3-Clause
// The instructor's page. Its token goes into a header of each request and is kept nowhere: no page of a lab, which has the
// same origin, can send it.
const PERIOD_MS = 2000;
// Below this a lab is slower than it should be.
const SLOW = 0.98;
const token = new URLSearchParams(location.search).get("token") ?? "";
const byId = (name) => document.getElementById(name);
const HEADINGS = [...document.querySelectorAll("th")].map((one) => one.textContent);

async function ask(path, method = "GET") {
  const answer = await fetch(path, {method, headers: {Authorization: `Bearer ${token}`}});
  if (!answer.ok) throw new Error(await answer.text());
  return answer.status === 204 ? null : answer.json();
}

function cell(text, kind) {
  const made = document.createElement("td");
  made.textContent = text;
  if (kind) made.className = kind;
  return made;
}

function link(text, address) {
  // Without a way back from the lab's page to this one.
  return Object.assign(document.createElement("a"), {textContent: text, href: address, target: "_blank",
                                                     rel: "noopener noreferrer"});
}

function button(lab, verb) {
  const made = document.createElement("button");
  made.textContent = verb;
  made.onclick = async () => {
    try {
      await ask(`labs/${lab.name}/${verb}`, "POST");
      byId("refused").textContent = "";
      await refresh();
    } catch (error) {
      byId("refused").textContent = error.message;
    }
  };
  return made;
}

// Exercise and points of the student's own checks, the last of each.
function verdictsOf(lab) {
  const made = cell("", "verdicts");
  for (const [name, {points, passed}] of Object.entries(lab.verdicts)) {
    const one = document.createElement("span");
    one.textContent = `${name} ${points === null ? "not graded" : Math.round(points)}`;
    one.dataset.passed = passed;
    made.append(one);
  }
  return made;
}

function megabytes(bytes) {
  return bytes === null ? "" : `${Math.round(bytes / 2 ** 20)} MB`;
}

const VERBS = {running: ["pause", "stop"], paused: ["start", "stop"], starting: ["stop"], waiting: ["stop"],
               stopped: ["start"], failed: ["start"]};

function row(lab) {
  const made = document.createElement("tr");
  made.dataset.state = lab.state;
  made.dataset.slow = lab.factor !== null && lab.factor < SLOW;
  const actions = cell("", "actions");
  actions.append(link("look in", `../${lab.name}/?token=${encodeURIComponent(lab.view_token)}`),
                 ...VERBS[lab.state].map((verb) => button(lab, verb)));
  made.append(cell(lab.full_name), cell(lab.reason ? `${lab.state}: ${lab.reason}` : lab.state, "state"),
              cell(lab.pages, "number"), cell(lab.factor?.toFixed(2) ?? "", "number factor"),
              cell(megabytes(lab.memory_bytes), "number"), cell(megabytes(lab.disk_bytes), "number"),
              cell(lab.unused_s === null ? "" : `${Math.round(lab.unused_s / 60)} min`, "number"),
              verdictsOf(lab), actions);
  // Narrow windows have no row of headings.
  HEADINGS.forEach((text, place) => { made.cells[place].dataset.heading = text; });
  return made;
}

// Rows by the name of their lab. What has not changed stays, so that a button can be clicked, or have the focus, meanwhile.
const rows = new Map();

async function refresh() {
  const {labs} = await ask("labs");
  for (const lab of labs) {
    const fresh = row(lab), shown = rows.get(lab.name);
    if (!shown) {
      rows.set(lab.name, fresh);
      byId("labs").append(fresh);
    } else {
      Object.assign(shown.dataset, fresh.dataset);
      [...fresh.cells].forEach((one, place) => {
        if (one.outerHTML !== shown.cells[place].outerHTML) shown.cells[place].replaceWith(one);
      });
    }
  }
  const of = (state) => labs.filter((lab) => lab.state === state).length;
  byId("told").textContent = [`${labs.filter((lab) => lab.pages).length} of ${labs.length} have a page open`,
                              ...["failed", "waiting"].filter(of).map((state) => `${of(state)} ${state}`)].join(", ");
}

async function keepOn() {
  try {
    await refresh();
  } catch (error) {
    byId("told").textContent = error.message;
  }
  setTimeout(keepOn, PERIOD_MS);
}

keepOn();
