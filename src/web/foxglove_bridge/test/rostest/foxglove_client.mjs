// SPDX-License-Identifier: BSD-3-Clause
// Drives the published @foxglove/ws-protocol (node foxglove_client.mjs FOLDER_WITH_NODE_MODULES URL) and prints what it
// saw as JSON. Messages are read and written by the published @foxglove/rosmsg-serialization.
import { createRequire } from "node:module";
import { join } from "node:path";

const [folder, url] = process.argv.slice(2);
const require = createRequire(join(folder, "package.json"));
const { FoxgloveClient } = require("@foxglove/ws-protocol");
const { parse } = require("@foxglove/rosmsg");
const { MessageReader, MessageWriter } = require("@foxglove/rosmsg-serialization");
const WebSocket = require("ws");

const client = new FoxgloveClient({
  ws: new WebSocket(url, [FoxgloveClient.SUPPORTED_SUBPROTOCOL, "foxglove.sdk.v1"]),
});
const faults = [];
client.on("error", error => faults.push(String(error)));

// The first event of a kind for which `found` gives something.
const until = (kind, found) => new Promise(resolve => {
  const listener = event => {
    const value = found(event);
    if (value !== undefined) {
      client.off(kind, listener);
      resolve(value);
    }
  };
  client.on(kind, listener);
});

const channels = new Map(), services = new Map();
const waiting = [];
const settle = () => {
  for (const [known, name, resolve] of [...waiting]) {
    if (known.has(name)) resolve(known.get(name));
  }
};
client.on("advertise", found => { found.forEach(one => channels.set(one.topic, one)); settle(); });
client.on("advertiseServices", found => { found.forEach(one => services.set(one.name, one)); settle(); });
const named = (known, name) => new Promise(resolve => { waiting.push([known, name, resolve]); settle(); });

const seen = {};
const info = await until("serverInfo", event => event);
seen.info = { name: info.name, capabilities: info.capabilities, encodings: info.supportedEncodings };

async function message(topic, fits = () => true) {
  const channel = await named(channels, topic);
  const reader = new MessageReader(parse(channel.schema));
  const received = until("message", event => {
    if (event.subscriptionId !== subscription) return undefined;
    const values = reader.readMessage(event.data);
    return fits(values) ? [values, Number(event.timestamp)] : undefined;
  });
  const subscription = client.subscribe(channel.id);
  const result = await received;
  client.unsubscribe(subscription);
  return [channel, ...result];
}

const [channel, state, timestamp] = await message("/lab/state");
seen.channel = { encoding: channel.encoding, schemaName: channel.schemaName, schemaEncoding: channel.schemaEncoding };
seen.state = [state.name, Array.from(state.position), state.header.stamp.sec];
seen.received = timestamp / 1e9;
seen.latched = (await message("/lab/latched"))[1].data;
seen.clock = (await message("/clock"))[1].clock.sec;
seen.strange = (await message("/lab/strange"))[1];
seen.time = Number(await until("time", event => event.timestamp)) / 1e9;

const text = new MessageWriter(parse("string data"));
for (const [encoding, data] of [["ros1", text.writeMessage({ data: "from ros1" })],
  ["json", new TextEncoder().encode(JSON.stringify({ data: "from json" }))]]) {
  const id = client.advertise({ topic: "/lab/heard", encoding, schemaName: "std_msgs/String" });
  // Again and again: until its subscriber is connected, a message is lost.
  const sending = setInterval(() => client.sendMessage(id, data), 200);
  seen[encoding] = (await message("/lab/echo", values => values.data === "from " + encoding))[1].data;
  clearInterval(sending);
  client.unadvertise(id);
}

async function call(name, callId, data) {
  const service = await named(services, name);
  const answer = Promise.race([
    until("serviceCallResponse", event => event.callId === callId
      ? new MessageReader(parse(service.response.schema)).readMessage(event.data) : undefined),
    until("serviceCallFailure", event => event.callId === callId ? event.message : undefined)]);
  const request = new MessageWriter(parse(service.request.schema)).writeMessage({ data });
  client.sendServiceCallRequest({ serviceId: service.id, callId, encoding: "ros1", data: request });
  return answer;
}
seen.service = await call("/lab/enable", 1, true);
seen.failure = await call("/lab/enable", 2, false);

const answered = id => until("parameterValues", event => event.id === id ? event.parameters : undefined);
const changed = name => until("parameterValues", event => event.id === undefined
  ? event.parameters.find(one => one.name === name) : undefined);
client.subscribeParameterUpdates(["/lab/number", "/lab/other"]);
client.setParameters([{ name: "/lab/number", value: 2, type: "float64" }], "set");
seen.set = await answered("set");
client.getParameters(["/lab/number", "/lab/nowhere"], "get");
seen.get = await answered("get");
client.getParameters([], "all");
seen.all = (await answered("all")).map(one => one.name).includes("/run_id");
const other = changed("/lab/other");
await call("/lab/set_other", 3, true);
seen.other = (await other).value;
const gone = changed("/lab/number");
client.setParameters([{ name: "/lab/number" }]);
seen.gone = "value" in await gone;

const graph = until("connectionGraphUpdate", event => event);
client.subscribeConnectionGraph();
const { publishedTopics, advertisedServices } = await graph;
seen.publishers = publishedTopics.find(one => one.name === "/lab/state").publisherIds;
seen.providers = advertisedServices.find(one => one.name === "/lab/enable").providerIds;
client.unsubscribeConnectionGraph();

async function asset(uri, requestId) {
  const response = until("fetchAssetResponse", event => event.requestId === requestId ? event : undefined);
  client.fetchAsset(uri, requestId);
  const { status, error, data } = await response;
  return [status, error ?? data.byteLength];
}
seen.mesh = await asset("package://rethink_ee_description/meshes/electric_gripper/electric_gripper_base.DAE", 1);
seen.noMesh = await asset("package://foxglove_bridge/package.xml", 2);
seen.outside = await asset("package://foxglove_bridge/../web_bridge/a.stl", 3);

const status = until("status", event => [event.level, event.message]);
client.subscribe(999999);
seen.status = await status;
seen.faults = faults;
client.close();
console.log(JSON.stringify(seen));
process.exit(0);
