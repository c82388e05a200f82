// Unpacks what python/interdrive/report/packing.py packed: the two files describe one format.

import type { Entry } from "./contract";

export type Values = Float32Array | Int32Array;

const SIZES = { u8: 1, i8: 1, i16: 2, i32: 4, f32: 4 };

/** Bytes of a zlib stream in base64. */
export async function inflate(text: string): Promise<Uint8Array> {
  const packed = Uint8Array.from(atob(text.trim()), (c) => c.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** One array; whole numbers stay whole where the resolution is 1 and nothing is absent. */
export function unpack(entry: Entry, bytes: Uint8Array): Values {
  const count = entry.shape.reduce((a, b) => a * b, 1);
  const size = SIZES[entry.type];
  if (entry.type === "f32") {
    const joined = new Uint8Array(4 * count);
    for (let plane = 0; plane < 4; plane++) for (let i = 0; i < count; i++) joined[4 * i + plane] = bytes[entry.at + plane * count + i];
    return new Float32Array(joined.buffer);
  }
  const whole = new Int32Array(count);
  for (let plane = 0; plane < size; plane++) {
    const at = entry.at + plane * count;
    for (let i = 0; i < count; i++) whole[i] |= bytes[at + i] << (8 * plane);
  }
  if (entry.type === "i8") for (let i = 0; i < count; i++) whole[i] = (whole[i] << 24) >> 24;
  if (entry.type === "i16") for (let i = 0; i < count; i++) whole[i] = (whole[i] << 16) >> 16;
  if (entry.steps) {
    const width = entry.shape[entry.shape.length - 1];
    for (let row = 0; row < count; row += width) {
      if (row > 0) whole[row] += whole[row - width];
      for (let i = row + 1; i < row + width; i++) whole[i] += whole[i - 1];
    }
  }
  const unit = entry.unit ?? 1;
  if (unit === 1 && entry.absent === undefined) return whole;
  const values = Float32Array.from(whole, (value) => value * unit);
  if (entry.absent !== undefined) for (let i = 0; i < count; i++) if ((bytes[entry.absent + (i >> 3)] >> (i & 7)) & 1) values[i] = NaN;
  return values;
}
