// Arrays as the page gets them, stored as plain 32-bit integers or floats.

import { deflateSync } from "node:zlib";
import type { Entry } from "../src/contract";

/** Entries of the header and the text of whole numbers and, where `NaN` or fractions occur, floats. */
export function packed(tables: Record<string, { shape: number[]; values: number[]; spacing?: number }>): [Record<string, Entry>, string] {
  const entries: Record<string, Entry> = {};
  const bytes: number[] = [];
  for (const [name, { shape, values, spacing }] of Object.entries(tables)) {
    const whole = values.every(Number.isInteger);
    entries[name] = { type: whole ? "i32" : "f32", shape, at: bytes.length, ...(spacing === undefined ? {} : { spacing }) };
    const raw = new Uint8Array((whole ? Int32Array.from(values) : Float32Array.from(values)).buffer);
    for (let plane = 0; plane < 4; plane++) for (let i = 0; i < values.length; i++) bytes.push(raw[4 * i + plane]);
  }
  return [entries, deflateSync(Uint8Array.from(bytes)).toString("base64")];
}
