// SPDX-License-Identifier: Apache-2.0
// The target as people type it: lengths in metres, as on the command line.
import type { CalibratedTarget, Target, TargetPoint } from '../api/types';

/** A target, or why what was typed is none. */
export type ParsedTarget = { target: Target; problem: '' } | { target: undefined; problem: string };

/** The fields of a form. Lengths in metres, frequencies in hertz; empty: not given. */
export interface TargetFields {
  kind: 'wand' | 'rigid' | 'point' | 'board';
  /** Positions along the wand. */
  markers: string;
  diameter: string;
  /** Blink frequency: one, or one for each marker. */
  hz: string;
  /** One sigma of each span. */
  tolerance: string;
  /** A rigid target: a line for each point. */
  points: string;
  /** A printed board, as on the command line. */
  board: string;
}

/** The board that a form begins with. */
export const usualBoard = 'board:checker,9x6,0.025';

/** The wand of the eWand paper. */
export const usualFields: TargetFields = { kind: 'wand', markers: '0, 0.13, 0.39', diameter: '', hz: '', tolerance: '', points: '', board: usualBoard };

/** One sigma of a coordinate that is not given, as in the file of a rigid target. */
const usualSigmaM = 0.0005;

const refuse = (problem: string): ParsedTarget => ({ target: undefined, problem });

function numbers(text: string): number[] | undefined {
  const parts = text.split(/[\s,]+/).filter((part) => part !== '');
  const values = parts.map(Number);
  return values.every(Number.isFinite) ? values : undefined;
}

/** A positive number, or undefined where nothing is given; NaN where it is neither. */
function positive(text: string): number | undefined {
  if (text.trim() === '') return undefined;
  const value = Number(text.trim().replace(',', '.'));
  return Number.isFinite(value) && value > 0 ? value : NaN;
}

/** Points of known coordinates, "label x y z sigma" in metres; or what is wrong with which line. */
export function parsePoints(text: string): { points: TargetPoint[]; problem: string } {
  const points: TargetPoint[] = [];
  const labels = new Set<string>();
  const refused = (line: number, why: string) => ({ points: [], problem: `Line ${line}: ${why}; a line is "A1 0.3 0 0.01 0.0002"` });
  for (const [i, raw] of text.split(/[\n|]/).entries()) {
    const line = raw.replace(/#.*/, '').trim();
    if (line === '') continue;
    const [label = '', ...rest] = line.split(/[\s,]+/).filter((part) => part !== '');
    const values = rest.map(Number);
    if (values.length < 3 || values.length > 4) return refused(i + 1, 'it has a label, x, y and z, and may have a sigma');
    if (!values.every(Number.isFinite)) return refused(i + 1, 'x, y, z and sigma are numbers');
    if (labels.has(label)) return refused(i + 1, `the label "${label}" is there twice`);
    const [x = 0, y = 0, z = 0, sigma = usualSigmaM] = values;
    if (Math.max(Math.abs(x), Math.abs(y), Math.abs(z)) > 100) return refused(i + 1, 'a coordinate is more than 100 m');
    if (sigma < 0) return refused(i + 1, 'sigma is negative');
    labels.add(label);
    points.push({ label, x_m: x, y_m: y, z_m: z, sigma_m: sigma });
  }
  return { points, problem: '' };
}

/** The target that the fields describe. */
export function targetOf(fields: TargetFields): ParsedTarget {
  if (fields.kind === 'board') {
    const board = fields.board.trim();
    if (!/^board:[a-z-]+,\d+x\d+,/.test(board)) return refuse(`A board is written as on the command line: ${usualBoard} (inner corners, metres).`);
    return { target: { kind: 'KIND_RIGID', board }, problem: '' };
  }
  const [diameter, tolerance] = [positive(fields.diameter), positive(fields.tolerance)];
  if (Number.isNaN(diameter)) return refuse('The diameter is a number of metres, such as 0.04, or empty.');
  if (diameter !== undefined && diameter > 1) return refuse(`A marker of ${fields.diameter.trim()} m: the diameter is in metres, such as 0.04.`);
  if (Number.isNaN(tolerance)) return refuse('The tolerance is a number of metres, such as 0.002, or empty.');
  const hz = numbers(fields.hz);
  if (!hz || hz.some((value) => value <= 0)) return refuse('The blink frequency is in hertz: 500, or one for each marker: 400, 500, 620');
  const common: Target = { ...(diameter ? { diameter_m: diameter } : {}), ...(hz.length > 0 ? { blink_hz: hz } : {}) };
  if (fields.kind === 'rigid') {
    const { points, problem } = parsePoints(fields.points);
    if (problem !== '') return refuse(problem);
    if (points.length < 4 || points.length > 200) return refuse('A rigid target has 4 to 200 points, a line for each: label x y z, in metres.');
    if (hz.length > 1 && hz.length !== points.length) return refuse(`${hz.length} blink frequencies for ${points.length} points: give one, or one for each.`);
    return { target: { kind: 'KIND_RIGID', points, ...common }, problem: '' };
  }
  if (fields.kind === 'point') return { target: { kind: 'KIND_POINT', marker_positions_m: [0], ...common }, problem: '' };
  const positions = numbers(fields.markers);
  if (fields.markers.trim() === '') return refuse('Give the positions of the markers along the wand in metres: 0, 0.13, 0.39');
  if (!positions) return refuse(`"${fields.markers.trim()}": positions are numbers, separated by commas`);
  if (positions.length > 16) return refuse('A wand has at most 16 markers.');
  if (positions.length < 2) return refuse('A wand has at least two markers: 0, 0.13, 0.39');
  if (positions[0] !== 0) return refuse('The first marker is at 0.');
  if (positions.some((p, i) => i > 0 && p <= positions[i - 1]!)) {
    return refuse('Positions increase from marker to marker: 0, 0.13, 0.39');
  }
  if (positions.at(-1)! > 20) return refuse(`A wand of ${positions.at(-1)} m: positions are in metres, such as 0, 0.13, 0.39`);
  if (hz.length > 1 && hz.length !== positions.length) return refuse(`${hz.length} blink frequencies for ${positions.length} markers: give one, or one for each.`);
  return { target: { kind: 'KIND_WAND', marker_positions_m: positions, ...common,
    ...(tolerance ? { span_tolerance_m: tolerance } : {}) }, problem: '' };
}

/** The fields of a text in the form of the command line ("wand:0,0.13,0.39;diameter=0.04;hz=500"), which may be
 * pasted; undefined: it is none. */
export function fieldsOfText(text: string): TargetFields | undefined {
  if (text.trim().startsWith('board:')) return { ...usualFields, kind: 'board', board: text.trim() };
  const match = /^(wand|point)(?::([^;]*))?(;.*)?$/.exec(text.trim());
  if (!match) return undefined;
  const fields: TargetFields = { ...usualFields, kind: match[1] as 'wand' | 'point', markers: match[2] ?? usualFields.markers };
  for (const option of (match[3] ?? '').split(';').filter(Boolean)) {
    const [name = '', value = ''] = option.split('=', 2);
    if (name !== 'diameter' && name !== 'hz' && name !== 'tolerance') return undefined;
    fields[name] = value;
  }
  return fields;
}

const shortNumber = (value: number): string => String(Number(value.toFixed(6)));

/** The fields that describe a target; undefined: a form has no fields for it. */
export function fieldsOf(target: Target | undefined): TargetFields | undefined {
  const kind = { KIND_WAND: 'wand', KIND_RIGID: 'rigid', KIND_POINT: 'point' }[String(target?.kind)] as TargetFields['kind'] | undefined;
  if (!target || !kind) return undefined;
  if (target.board) return { ...usualFields, kind: 'board', board: target.board };
  return {
    kind, markers: kind === 'wand' ? (target.marker_positions_m ?? []).map(shortNumber).join(', ') : usualFields.markers,
    diameter: target.diameter_m ? shortNumber(target.diameter_m) : '', hz: (target.blink_hz ?? []).map(shortNumber).join(', '),
    tolerance: target.span_tolerance_m ? shortNumber(target.span_tolerance_m) : '',
    points: (target.points ?? []).map((p) => [p.label, ...[p.x_m, p.y_m, p.z_m, p.sigma_m].map((v) => shortNumber(v ?? 0))].join(' ')).join('\n'),
    board: usualBoard,
  };
}

/** A target as the command line writes it; of labelled points only how many there are. */
export function targetText(target: Target | undefined): string {
  if (!target) return '';
  const options = [
    target.diameter_m ? `;diameter=${shortNumber(target.diameter_m)}` : '',
    target.blink_hz?.length ? `;hz=${target.blink_hz.map(shortNumber).join(',')}` : '',
    target.span_tolerance_m ? `;tolerance=${shortNumber(target.span_tolerance_m)}` : '',
  ].join('');
  if (target.board) return target.board;
  if (target.kind === 'KIND_RIGID') return `rigid, ${target.points?.length ?? 0} points${options}`;
  if (target.kind === 'KIND_STATIC') return `${target.points?.length ?? 0} static points`;
  if (target.kind === 'KIND_POINT') return `point${options}`;
  return target.marker_positions_m?.length ? `wand:${target.marker_positions_m.map(shortNumber).join(',')}${options}` : '';
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
