// Frames on the wire, as in docs/reference/protocol.md: COBS(id, sequence, payload, CRC-16) and a zero byte.

const MAX_ENCODED_BYTES = 128;

function crc16(bytes) {
  let crc = 0xffff;
  for (const byte of bytes) {
    crc ^= byte;
    for (let bit = 0; bit < 8; ++bit) crc = crc & 1 ? (crc >> 1) ^ 0x8408 : crc >> 1;
  }
  return crc ^ 0xffff;
}

/** Return the bytes of a frame, with a delimiter before and after it. */
export function encodeFrame(id, sequence, payload) {
  const body = [id, sequence, ...payload];
  const crc = crc16(body);
  const blocks = [[]];
  for (const byte of [...body, crc & 0xff, crc >> 8])
    if (byte === 0) blocks.push([]);
    else blocks.at(-1).push(byte);
  return [0, ...blocks.flatMap((block) => [block.length + 1, ...block]), 0];
}

function decodeBody(encoded) {
  const body = [];
  for (let i = 0; i < encoded.length; ) {
    const length = encoded[i];
    body.push(...encoded.slice(i + 1, i + length));
    i += length;
    if (i < encoded.length) body.push(0);
  }
  const crc = crc16(body.slice(0, -2));
  return body.length >= 4 && body.at(-2) === (crc & 0xff) && body.at(-1) === crc >> 8 ? body.slice(0, -2) : null;
}

/** Return a function that takes bytes one by one and calls `onFrame(id, sequence, payload)` for each whole frame. */
export function frameDecoder(onFrame) {
  let pending = [];
  return (byte) => {
    if (byte !== 0) {
      if (pending.length < MAX_ENCODED_BYTES) pending.push(byte);
      return;
    }
    const body = pending.length > 0 ? decodeBody(pending) : null;
    pending = [];
    if (body) onFrame(body[0], body[1], Uint8Array.from(body.slice(2)));
  };
}
