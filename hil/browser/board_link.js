// The host's end of the cable: commands to the board, and what it answers.
import { encodeFrame, frameDecoder } from "./framing.js";

export class BoardLink {
  /** `send(bytes)` puts bytes on the wire; `onMessage(name, fields)` gets each message from the board. */
  constructor(protocol, { send, onMessage }) {
    this.protocol = protocol;
    this.plugged = true;
    this.onByte = frameDecoder((id, sequence, payload) => {
      const message = this.plugged ? protocol.unpack(id, payload) : null;
      if (message) onMessage(message.name, message.fields);
    });
    this.sendBytes = send;
    this.sequence = 0;
  }

  request(name, fields) {
    const { id, payload } = this.protocol.pack(name, fields);
    this.sequence = (this.sequence + 1) & 0xff;
    if (this.plugged) this.sendBytes(encodeFrame(id, this.sequence, payload));
  }

  command(name) {
    this.request("command_request", { command: this.protocol.value("Command", name) });
  }

  setParameter(name, value) {
    const index = this.protocol.parameters.findIndex((one) => one.name === name);
    this.request("set_parameter", { index, value: Math.round(value * this.protocol.parameters[index].scale) });
  }

  /** Send set-points [rad/s], twice: one wrong bit must not stop the robot. */
  setWheelSpeeds([left, right]) {
    const fields = { left: Math.round(1000 * left), right: Math.round(1000 * right) };
    this.request("set_wheel_speeds", fields);
    this.request("set_wheel_speeds", fields);
  }
}
