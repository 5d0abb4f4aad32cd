// SPDX-License-Identifier: Apache-2.0
// What a join string says of its server; common/identity/join_string.h describes the fields.
import { toBytes } from '../api/json_values';

const prefix = 'rk1.';
const fixedBytes = 1 + 8 + 32 + 16;

/** "https://HOST:PORT" of each address of the server that made the string; none where it is damaged. */
export function serverAddresses(joinString: string): string[] {
  if (!joinString.startsWith(prefix)) return [];
  const bytes = toBytes(joinString.slice(prefix.length));
  const text = (at: number): string => new TextDecoder().decode(bytes.subarray(at + 1, at + 1 + (bytes[at] ?? 0)));
  let at = fixedBytes;
  at += 1 + (bytes[at] ?? 0) + 2;
  const port = 256 * (bytes[at] ?? 0) + (bytes[at + 1] ?? 0);
  at += 2;
  const hosts: string[] = [];
  for (let left = bytes[at++] ?? 0; left > 0 && at < bytes.length; --left) {
    const host = text(at);
    if (/^[\w.:-]+$/.test(host)) hosts.push(host.includes(':') ? `[${host}]` : host);
    at += 1 + (bytes[at] ?? 0);
  }
  return hosts.map((host) => `https://${host}:${port}`);
}
