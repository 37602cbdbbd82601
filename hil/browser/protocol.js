// Messages between host and board, packed and unpacked by their schema, firmware/protocol/messages.toml.

const ACCESS = {
  u8: [1, "Uint8"], i16: [2, "Int16"], u16: [2, "Uint16"], i32: [4, "Int32"], u32: [4, "Uint32"],
};

export class Protocol {
  constructor(schema) {
    this.messages = schema.message;
    this.parameters = schema.parameter;
    this.enums = Object.fromEntries(schema.enum.map((one) => [one.name, one.values]));
  }

  /** Return the number of an enumeration's name. */
  value(enumeration, name) {
    return this.enums[enumeration].find((entry) => entry.name === name).value;
  }

  /** Return the name of an enumeration's number. */
  name(enumeration, value) {
    return this.enums[enumeration].find((entry) => entry.value === value).name;
  }

  /** Return id and payload of a message with these fields. */
  pack(name, fields) {
    const message = this.messages.find((one) => one.name === name);
    const view = new DataView(new ArrayBuffer(sizeOf(message)));
    eachField(message, (field, offset, type) => view[`set${type}`](offset, fields[field.name], true));
    return { id: message.id, payload: new Uint8Array(view.buffer) };
  }

  /** Return name and fields of a message, or null if it is unknown. */
  unpack(id, payload) {
    const message = this.messages.find((one) => one.id === id);
    if (!message || sizeOf(message) !== payload.length) return null;
    const view = new DataView(payload.buffer);
    const fields = {};
    eachField(message, (field, offset, type) => (fields[field.name] = view[`get${type}`](offset, true)));
    return { name: message.name, fields };
  }
}

function sizeOf(message) {
  return message.fields.reduce((sum, field) => sum + ACCESS[field.type][0], 0);
}

function eachField(message, use) {
  let offset = 0;
  for (const field of message.fields) {
    const [size, type] = ACCESS[field.type];
    use(field, offset, type);
    offset += size;
  }
}
