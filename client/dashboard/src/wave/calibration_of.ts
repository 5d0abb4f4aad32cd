// SPDX-License-Identifier: Apache-2.0
import { useState } from 'preact/hooks';
import { getCalibration, listCalibrations } from '../api/server_api';
import type { Calibration, Session } from '../api/types';
import { hasEnded } from '../result/grade';
import { useLoaded } from '../shell/use_async';

/** While one is solved; else another one may be made elsewhere. */
const solvingMs = 700, idleMs = 4000;

/** The newest calibration of a finished session, whoever made it. `lookAgain` when one was just made. */
export function useCalibrationOf(session: Session | undefined): { calibration: Calibration | undefined; lookAgain: () => void } {
  const [solving, setSolving] = useState(false);
  const of = session?.state === 'STATE_FINISHED' && !session.discard_time ? session.id ?? '' : '';
  const loaded = useLoaded(`calibration of ${of}`, async (signal): Promise<Calibration | undefined> => {
    if (of === '') return undefined;
    const newest = (await listCalibrations({ filter: `session_ids:${of}`, page_size: 1 }, signal)).calibrations?.[0];
    const open = newest !== undefined && !hasEnded(newest.state);
    setSolving(open);
    return open ? getCalibration(newest.id ?? '', signal) : newest;
  }, of === '' ? 0 : solving ? solvingMs : idleMs);
  return { calibration: loaded.value, lookAgain: () => {
    setSolving(true);
    loaded.reload();
  } };
}
