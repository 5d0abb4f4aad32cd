// SPDX-License-Identifier: Apache-2.0
// The target as people type it.
import type { CalibratedTarget, Target } from '../api/types';

/** A target, or why the text is none. */
export type ParsedTarget = { target: Target; problem: '' } | { target: undefined; problem: string };

const refuse = (problem: string): ParsedTarget => ({ target: undefined, problem });

function numbers(text: string): number[] | undefined {
  const parts = text.split(/[\s,]+/).filter((part) => part !== '');
  const values = parts.map(Number);
  return values.every(Number.isFinite) ? values : undefined;
}

/** Reads marker positions in millimetres ("0, 130, 390"), or the form of the command line in metres
 * ("wand:0,0.13,0.39;diameter=0.04;hz=500;tolerance=0.002", "point"). */
export function parseTarget(text: string): ParsedTarget {
  const trimmed = text.trim();
  if (trimmed === '') return refuse('Give the positions of the markers along the wand in millimetres: 0, 130, 390');
  const target: Target = {};
  let positions: number[] | undefined;
  if (/^(wand|point)\b/.test(trimmed)) {
    const [head = '', ...options] = trimmed.split(';');
    const [kind, list = ''] = head.split(':', 2);
    target.kind = kind === 'point' ? 'KIND_POINT' : 'KIND_WAND';
    positions = kind === 'point' && list === '' ? [0] : numbers(list);
    for (const option of options) {
      const [name, value = ''] = option.split('=', 2);
      const values = numbers(value);
      if (!values?.length) return refuse(`"${option}": not a number`);
      if (name === 'diameter') target.diameter_m = values[0];
      else if (name === 'tolerance') target.span_tolerance_m = values[0];
      else if (name === 'hz') target.blink_hz = values;
      else return refuse(`"${option}": known are diameter, hz and tolerance`);
    }
  } else {
    target.kind = 'KIND_WAND';
    positions = numbers(trimmed)?.map((mm) => mm / 1000);
  }
  if (!positions) return refuse(`"${trimmed}": positions are numbers, separated by commas`);
  if (positions.length > 16) return refuse('A wand has at most 16 markers.');
  if (target.kind === 'KIND_WAND' && positions.length < 2) return refuse('A wand has at least two markers: 0, 130, 390');
  if (positions[0] !== 0) return refuse('The first marker is at 0.');
  if (positions.some((p, i) => i > 0 && p <= positions[i - 1]!)) {
    return refuse('Positions increase from marker to marker: 0, 130, 390');
  }
  if (positions.at(-1)! > 20) return refuse('The wand is longer than 20 m: positions are in millimetres.');
  return { target: { ...target, marker_positions_m: positions }, problem: '' };
}

const shortNumber = (value: number): string => String(Number(value.toFixed(4)));

/** The text that parseTarget reads as this target. */
export function targetText(target: Target | undefined): string {
  const positions = target?.marker_positions_m ?? [];
  if (!target || positions.length === 0) return '';
  const options = [
    target.diameter_m ? `;diameter=${shortNumber(target.diameter_m)}` : '',
    target.blink_hz?.length ? `;hz=${target.blink_hz.map(shortNumber).join(',')}` : '',
    target.span_tolerance_m ? `;tolerance=${shortNumber(target.span_tolerance_m)}` : '',
  ].join('');
  if (target.kind === 'KIND_POINT') return `point${options}`;
  if (options === '') return positions.map((m) => shortNumber(m * 1000)).join(', ');
  return `wand:${positions.map(shortNumber).join(',')}${options}`;
}

/** A further target of a calibration, and where it was seen. */
export function otherTargetText(other: CalibratedTarget): string {
  const kind = other.given?.kind;
  const points = other.given?.points?.length ?? 0;
  const sessions = (other.session_ids ?? []).join(', ');
  if (kind === 'KIND_STATIC') return `Also ${points} static points, seen in ${sessions}`;
  const what = kind === 'KIND_RIGID' ? `a rigid target of ${points} points`
    : kind === 'KIND_POINT' ? 'a single point' : 'a wand';
  return `Also ${what}, waved in ${sessions}`;
}
