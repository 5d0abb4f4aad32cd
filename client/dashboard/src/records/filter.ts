// SPDX-License-Identifier: Apache-2.0

/** A filter of a list call: terms of what is given, values quoted where they must be. */
export function filterText(fields: Record<string, string>): string {
  return Object.entries(fields).filter(([, value]) => value !== '').map(([name, value]) =>
    `${name}=${/^[A-Za-z0-9_\-./]+$/.test(value) ? value : `"${value.replaceAll(/["\\]/g, '')}"`}`).join(' AND ');
}

/** Whether a text is somewhere in one of the values, whatever its case. */
export function matches(text: string, values: readonly (string | undefined)[]): boolean {
  const wanted = text.trim().toLowerCase();
  return wanted === '' || values.some((value) => value?.toLowerCase().includes(wanted));
}
