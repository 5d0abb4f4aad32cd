// SPDX-License-Identifier: Apache-2.0
// Values as protobuf JSON writes them: 64-bit integers are strings, durations "1.5s", bytes base64.

/** Number of a uint64 or int64; missing is 0. Exact up to 2^53. */
export function toCount(value: string | number | undefined): number {
  if (value === undefined) return 0;
  const number = Number(value);
  return Number.isFinite(number) ? number : 0;
}

/** Seconds of a duration such as "1.250s"; undefined where it is missing or not one. */
export function durationSeconds(value: string | undefined): number | undefined {
  if (value === undefined) return undefined;
  const match = /^(-?\d+(?:\.\d+)?)s$/.exec(value);
  return match ? Number(match[1]) : undefined;
}

/** A duration of so many seconds. */
export function toDuration(seconds: number): string {
  return `${Number(seconds.toFixed(3))}s`;
}

/** Milliseconds since 1970 of a timestamp; undefined where it is missing or not one. */
export function timeMs(value: string | undefined): number | undefined {
  if (value === undefined) return undefined;
  const ms = Date.parse(value);
  return Number.isNaN(ms) ? undefined : ms;
}

/** Octets of a base64 text; empty where it is missing or damaged. */
export function toBytes(value: string | undefined): Uint8Array {
  if (!value) return new Uint8Array(0);
  try {
    const text = atob(value.replaceAll('-', '+').replaceAll('_', '/'));
    const bytes = new Uint8Array(text.length);
    for (let i = 0; i < text.length; ++i) bytes[i] = text.charCodeAt(i);
    return bytes;
  } catch {
    return new Uint8Array(0);
  }
}
