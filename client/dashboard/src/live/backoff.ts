// SPDX-License-Identifier: Apache-2.0

/** Milliseconds to wait after so many failures in a row: 0.25 s, doubling to 5 s, and up to a fifth
 * less, by `random` in [0, 1), so that many pages do not come back at one instant. */
export function backoffMs(failures: number, random: number): number {
  const full = Math.min(5000, 250 * 2 ** Math.max(0, failures - 1));
  return full * (1 - 0.2 * random);
}
