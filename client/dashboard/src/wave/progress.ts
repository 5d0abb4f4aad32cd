// SPDX-License-Identifier: Apache-2.0
// How far the wave is: one word, one colour, one figure, for the page and the distance mode.
import type { LiveEstimate } from '../api/types';
import type { RigState } from '../live/live_merge';
import { errorQuality, wantedMm } from '../view/colour_scale';

/** Where the wave stands. */
export type Stage = 'no_session' | 'waiting' | 'failed' | 'waving' | 'near' | 'reached' | 'ended' | 'stale';

/** What is shown of it. */
export interface Progress {
  stage: Stage;
  /** "Keep waving" */
  word: string;
  symbol: string;
  /** Expected error, 95th percentile, millimetres. Undefined: there is none. */
  nowMm: number | undefined;
  goalMm: number | undefined;
  /** 0 bad to 1 good. */
  quality: number;
}

/** The session captures now. */
export function isCapturing(rig: RigState): boolean {
  return rig.session?.state === 'STATE_CAPTURING';
}

/** The figure of an estimate; undefined: there is none, or its lengths are of no known scale. */
export function figureOf(estimate: LiveEstimate | undefined): number | undefined {
  const value = estimate?.volume?.p95_mm;
  return value !== undefined && value > 0 && estimate?.scale_known ? value : undefined;
}

/** Progress of a rig. */
export function progressOf(rig: RigState, stale: boolean): Progress {
  const nowMm = figureOf(rig.estimate);
  const goalMm = rig.goal?.until_mm ?? rig.session?.goal?.until_mm;
  const quality = nowMm === undefined ? 0 : errorQuality(nowMm, wantedMm(goalMm));
  const make = (stage: Stage, symbol: string, word: string): Progress =>
    ({ stage, symbol, word, nowMm, goalMm, quality });
  if (stale) return make('stale', '⚠', 'Old data');
  if (!rig.session) return make('no_session', '○', 'No session');
  if (!isCapturing(rig)) {
    if (rig.session.state === 'STATE_CREATED') return make('no_session', '○', 'Ready to start');
    return rig.goal?.reached ? make('reached', '✓', 'Good enough') : make('ended', '■', rig.session.state === 'STATE_FINISHED' ? 'Finished' : 'Stopped');
  }
  if (rig.goal?.reached) return make('reached', '✓', 'Good enough');
  if (nowMm === undefined) {
    return rig.estimate?.state === 'STATE_FAILED' ? make('failed', '✕', 'No solution yet')
      : make('waiting', '…', 'Wave: too little yet');
  }
  if (goalMm !== undefined && nowMm < goalMm) return make('near', '▲', 'Below the goal, checking');
  if (goalMm !== undefined && nowMm < 1.5 * goalMm) return make('near', '▲', 'Nearly there');
  return make('waving', '●', 'Keep waving');
}
