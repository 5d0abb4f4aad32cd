// SPDX-License-Identifier: Apache-2.0
import { ApiError, getCalibration, getSession } from '../api/server_api';
import type { Calibration } from '../api/types';

/** So far back a frame or a scale is followed to the calibration that was solved. */
const mostParents = 8;
const mostSessions = 8;

/** The goal of the sessions that a calibration was solved from, the newest first, millimetres: colours are made for it,
 * as on the Wave page. Undefined: they had none, or are gone. */
export async function goalOf(calibration: Calibration, signal: AbortSignal): Promise<number | undefined> {
  try {
    let solved = calibration;
    for (let i = 0; i < mostParents && ['KIND_ORIGIN', 'KIND_SCALE'].includes(String(solved.options?.kind)) && solved.options?.parent_id; ++i) {
      solved = await getCalibration(solved.options.parent_id, signal);
    }
    for (const id of (solved.session_ids ?? []).slice(-mostSessions).reverse()) {
      const goal = (await getSession(id, signal)).goal?.until_mm;
      if (goal) return goal;
    }
  } catch (error) {
    if (!(error instanceof ApiError) || error.code !== 'NOT_FOUND') throw error;
  }
  return undefined;
}
