// SPDX-License-Identifier: BSD-3-Clause
// Topics of ROS, over rosbridge's protocol; subscriptions outlive a lost connection.
const RETRY_MS = 1000;

export class Topics {
  constructor(address) {
    this.address = address;
    this.wanted = new Map();
    this.connect();
  }

  connect() {
    this.socket = new WebSocket(this.address);
    this.socket.onopen = () => this.wanted.forEach((wish) => this.send(wish.operation));
    this.socket.onmessage = ({data}) => {
      const {op, topic, msg} = JSON.parse(data);
      if (op === "publish") this.wanted.get(topic)?.arrived(msg);
    };
    this.socket.onclose = () => setTimeout(() => this.connect(), RETRY_MS);
  }

  send(operation) {
    if (this.socket.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(operation));
  }

  // One subscription for each topic; period_ms: the shortest time between two messages.
  subscribe(topic, type, period_ms, queue_length, arrived) {
    const operation = {op: "subscribe", topic, type, throttle_rate: period_ms, queue_length};
    this.wanted.set(topic, {operation, arrived});
    this.send(operation);
  }

  unsubscribe(topic) {
    if (this.wanted.delete(topic)) this.send({op: "unsubscribe", topic});
  }
}
