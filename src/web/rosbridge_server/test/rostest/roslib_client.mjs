// SPDX-License-Identifier: BSD-3-Clause
// Drives the published roslib (node roslib_client.mjs FOLDER_WITH_NODE_MODULES PACKAGE URL) and prints what it saw as JSON.
import { createRequire } from "node:module";
import { existsSync } from "node:fs";
import { join } from "node:path";
import { pathToFileURL } from "node:url";

const [folder, name, url] = process.argv.slice(2);
const asModule = join(folder, "node_modules", name, "dist", "RosLib.js");
const ROSLIB = existsSync(asModule)
  ? await import(pathToFileURL(asModule))
  : createRequire(join(folder, "package.json"))(name);

// A promise of what a function with callbacks gives.
const given = call => new Promise((resolve, reject) => call(resolve, reason => reject(new Error(String(reason)))));

async function connect() {
  const ros = new ROSLIB.Ros({ url });
  await given((done, failed) => { ros.on("connection", done); ros.on("error", failed); });
  return ros;
}

// Each step is told on stderr: after a time-out the last line says where it stopped.
const seen = new Proxy({}, { set: (found, key, value) => { console.error(key); found[key] = value; return true; } });
// Does it now and again and again, until the promise has come: until its subscriber is connected, a message is lost.
async function repeated(act, promise) {
  act();
  const timer = setInterval(act, 1000);
  try {
    return await promise;
  } finally {
    clearInterval(timer);
  }
}
const ros = await connect();

for (const compression of ["none", "png", "cbor", "cbor-raw"]) {
  const own = await connect();
  const topic = new ROSLIB.Topic({ ros: own, name: "/lab/state", messageType: "sensor_msgs/JointState", compression });
  const message = await given(done => topic.subscribe(done));
  seen[compression] = compression === "cbor-raw"
    ? [message.bytes.length > 0, message.secs > 0]
    : [message.name, Array.from(message.position)];
  topic.unsubscribe();
  own.close();
}

const heard = new ROSLIB.Topic({ ros, name: "/lab/heard", messageType: "std_msgs/String" });
const echoed = new ROSLIB.Topic({ ros, name: "/lab/echo", messageType: "std_msgs/String" });
// It is latched: what another client said may come first.
const echo = given(done => echoed.subscribe(({ data }) => data.endsWith(name) && done(data)));
seen.echo = await repeated(() => heard.publish({ data: "from " + name }), echo);

const enable = new ROSLIB.Service({ ros, name: "/lab/enable", serviceType: "std_srvs/SetBool" });
seen.service = await given((done, failed) => enable.callService({ data: true }, done, failed));
const missing = new ROSLIB.Service({ ros, name: "/lab/nowhere", serviceType: "std_srvs/SetBool" });
seen.missing = await given(done => missing.callService({}, () => done("answered"), done));

const offered = new ROSLIB.Service({ ros, name: "/lab/offered", serviceType: "std_srvs/SetBool" });
const asked = given(done => offered.advertise((request, response) => {
  response.success = request.data;
  response.message = name;
  setTimeout(() => done(request.data), 0);
  return true;
}));
const ask = new ROSLIB.Service({ ros, name: "/lab/ask_offered", serviceType: "std_srvs/SetBool" });
seen.answer = await given((done, failed) => ask.callService({ data: true }, done, failed));
seen.offered = await asked;
offered.unadvertise();

const param = new ROSLIB.Param({ ros, name: "/lab/number" });
await given((done, failed) => param.set({ a: [1, 2.5, "x"] }, done, failed));
seen.param = await given((done, failed) => param.get(done, failed));
await given((done, failed) => param.delete(done, failed));
seen.deleted = await given((done, failed) => param.get(done, failed));

seen.topics = (await given((done, failed) => ros.getTopics(done, failed))).topics.includes("/lab/state");
seen.services = (await given((done, failed) => ros.getServices(done, failed))).includes("/lab/enable");
seen.nodes = (await given((done, failed) => ros.getNodes(done, failed))).includes("/rosapi");
seen.type = await given((done, failed) => ros.getTopicType("/lab/state", done, failed));
seen.serviceType = await given((done, failed) => ros.getServiceType("/lab/enable", done, failed));
seen.details = ros.decodeTypeDefs(
  await given((done, failed) => ros.getMessageDetails("sensor_msgs/JointState", done, failed)));
seen.actions = await given((done, failed) => ros.getActionServers(done, failed));

const client = new ROSLIB.ActionClient({ ros, serverName: "/lab/act", actionName: "actionlib/TestAction" });
const goal = new ROSLIB.Goal({ actionClient: client, goalMessage: { goal: 5 } });
const feedback = given(done => goal.on("feedback", done));
const result = given(done => goal.on("result", done));
// A goal that comes twice counts once.
seen.action = await repeated(() => goal.send(), Promise.all([feedback, result])).then(
  ([one, other]) => [one.feedback, other.result]);

for (const [key, groovyCompatibility] of [["tfAction", true], ["tfService", false]]) {
  const tf = new ROSLIB.TFClient({ ros, fixedFrame: "base", rate: 20, groovyCompatibility, topicTimeout: 30 });
  const there = given(done => tf.subscribe("hand", done));
  seen[key] = (await repeated(() => tf.republisherUpdateRequested || tf.updateGoal(), there)).translation.x;
  tf.dispose();
}

ros.close();
console.log(JSON.stringify(seen));
process.exit(0);
