// SPDX-License-Identifier: Apache-2.0
// Numbers and times as text. Missing values are an en dash.

export const missing = '–';

const known = (value: number | undefined): value is number =>
  value !== undefined && Number.isFinite(value);

/** With so many decimals; missing where there is no number. */
export function fixed(value: number | undefined, decimals: number): string {
  if (!known(value)) return missing;
  const text = value.toFixed(decimals);
  return /^-0(\.0+)?$/.test(text) ? text.slice(1) : text.replace('-', '−');
}

/** Millimetres with about three digits, without the unit: 0.046, 0.46, 4.6, 46. */
export function millimetres(value: number | undefined): string {
  if (!known(value)) return missing;
  const size = Math.abs(value);
  return fixed(value, size < 0.0995 ? 3 : size < 9.95 ? 2 : size < 99.5 ? 1 : 0);
}

/** A count with thin spaces between thousands; large ones are shortened: 12.3 k. */
export function count(value: number | undefined): string {
  if (!known(value)) return missing;
  if (Math.abs(value) >= 1e6) return `${fixed(value / 1e6, 1)} M`;
  if (Math.abs(value) >= 1e5) return `${fixed(value / 1e3, 0)} k`;
  return Math.round(value).toString().replace(/\B(?=(\d{3})+$)/g, '\u202f');
}

/** Bytes in binary steps: 3.2 MiB. */
export function bytes(value: number | undefined): string {
  if (!known(value)) return missing;
  const units = ['B', 'KiB', 'MiB', 'GiB', 'TiB'];
  let rest = value;
  let unit = 0;
  while (rest >= 1024 && unit + 1 < units.length) {
    rest /= 1024;
    unit += 1;
  }
  return `${fixed(rest, unit === 0 || rest >= 100 ? 0 : 1)} ${units[unit]}`;
}

/** A time of seconds with the unit that suits it: 12 µs, 3.4 ms, 1.2 s. */
export function seconds(value: number | undefined): string {
  if (!known(value)) return missing;
  const size = Math.abs(value);
  if (size === 0) return '0 ms';
  if (size < 1e-4) return `${fixed(value * 1e6, 0)} µs`;
  if (size < 0.1) return `${fixed(value * 1e3, size < 0.01 ? 2 : 1)} ms`;
  return `${fixed(value, size < 10 ? 2 : 1)} s`;
}

/** Milliseconds, with so many decimals, without the unit. */
export function inMs(valueS: number | undefined, decimals = 3): string {
  return known(valueS) ? fixed(valueS * 1e3, decimals) : missing;
}

/** A span of seconds for a person: 4 s, 3 min 05 s, 2 h 10 min, 3 d 4 h. */
export function span(totalS: number | undefined): string {
  if (!known(totalS)) return missing;
  const s = Math.max(0, Math.floor(totalS));
  if (s < 60) return `${s} s`;
  if (s < 3600) return `${Math.floor(s / 60)} min ${String(s % 60).padStart(2, '0')} s`;
  if (s < 86400) return `${Math.floor(s / 3600)} h ${Math.floor((s % 3600) / 60)} min`;
  return `${Math.floor(s / 86400)} d ${Math.floor((s % 86400) / 3600)} h`;
}

/** Date and time of day, local: 2026-11-23 14:05. */
export function dateTime(ms: number | undefined): string {
  if (!known(ms)) return missing;
  const date = new Date(ms);
  const two = (value: number) => String(value).padStart(2, '0');
  return `${date.getFullYear()}-${two(date.getMonth() + 1)}-${two(date.getDate())} ` +
    `${two(date.getHours())}:${two(date.getMinutes())}`;
}

/** A share of 0 to 1 as per cent. */
export function percent(share: number | undefined, decimals = 0): string {
  return known(share) ? `${fixed(share * 100, decimals)} %` : missing;
}

/** The value of an enum without its prefix, as words: STATE_CAPTURING -> capturing. */
// A value of a later version comes as its number.
export function enumWords(value: string | number | undefined, prefix: string): string {
  if (!value) return missing;
  if (typeof value === 'number') return `unknown kind ${value}`;
  return (value.startsWith(prefix) ? value.slice(prefix.length) : value).toLowerCase().replaceAll('_', ' ');
}

/** The scale's part of every length, on top of an expected error. */
export function scaleText(sigmaRel: number | undefined): string {
  return sigmaRel ? `+ ${(100 * sigmaRel).toFixed(2)} % of every length` : missing;
}
