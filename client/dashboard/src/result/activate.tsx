// SPDX-License-Identifier: Apache-2.0
// Which calibration of a rig is active: the mark, the button, the history, and the way back.
import type { JSX } from 'preact';
import { useState } from 'preact/hooks';
import { timeMs } from '../api/json_values';
import { activateCalibration, ApiError, errorText, listActivations, rollbackRig } from '../api/server_api';
import type { Activation, Calibration } from '../api/types';
import { Chip, Panel, Problem, WorkButton } from '../shell/parts';
import { useFeed } from '../shell/feed_context';
import { hashOf } from '../shell/route';
import { useLoaded } from '../shell/use_async';
import { dateTime } from '../view/format';

const who = (one: Activation): string => one.operator_name || "the server's PC";

/** The history of a rig, newest first; none where nothing was ever active. */
async function historyOf(rig: string, signal: AbortSignal): Promise<readonly Activation[]> {
  try {
    return (await listActivations(rig, signal)).activations ?? [];
  } catch (error) {
    if (error instanceof ApiError && error.code === 'NOT_FOUND') return [];
    throw error;
  }
}

/** Does what may be refused for a reason that a person can overrule; then offers to do it nevertheless. */
function Overrulable({ work, verb, anyway, kind, disabled }: {
  work: (force: boolean) => Promise<void>; verb: string; anyway: string; kind?: 'primary' | 'quiet'; disabled?: boolean;
}): JSX.Element {
  const [refused, setRefused] = useState('');
  const attempt = async (force: boolean): Promise<void> => {
    try {
      await work(force);
      setRefused('');
    } catch (error) {
      if (force || !(error instanceof ApiError) || error.code !== 'FAILED_PRECONDITION') throw error;
      setRefused(errorText(error));
    }
  };
  if (refused === '') return <WorkButton kind={kind} disabled={disabled} work={() => attempt(false)}>{verb}</WorkButton>;
  return <><Problem text={refused} />
    <WorkButton kind="danger" disabled={disabled} work={() => attempt(true)}>{anyway}</WorkButton>
    <button type="button" class="quiet" onClick={() => setRefused('')}>Leave it</button></>;
}

/** Makes a calibration the active one of its rig; says so where it is. */
export function Activate({ calibration, disabled, onChange }: {
  calibration: Calibration; disabled?: boolean; onChange?: () => void;
}): JSX.Element | null {
  const rig = calibration.rig ?? '';
  const { stale } = useFeed();
  const history = useLoaded(`active ${rig}`, (signal) => historyOf(rig, signal), 5000);
  if (calibration.state !== 'STATE_SUCCEEDED') return null;
  if (calibration.options?.what_if) return <p class="hint">A what-if: it can never become active.</p>;
  const active = history.value?.[0];
  if (active?.calibration_id === calibration.id) {
    return <p class="active"><Chip mark={stale ? 'idle' : 'good'}>{stale ? 'Was active' : 'Active'} since {dateTime(timeMs(active?.time))}</Chip></p>;
  }
  return <Overrulable kind="primary" disabled={disabled || stale} verb="Activate" anyway="Activate it nevertheless" work={async (force) => {
    await activateCalibration(calibration.id ?? '', '', force);
    history.reload();
    onChange?.();
  }} />;
}

/** What was active when, by whom and why; and back to the one before. */
export function ActiveHistory({ rig, turn, onChange }: { rig: string; turn: number; onChange: () => void }): JSX.Element {
  const { stale } = useFeed();
  const loaded = useLoaded(`history ${rig} ${turn}`, (signal) => historyOf(rig, signal), 10000);
  const history = loaded.value ?? [];
  const before = history[0]?.previous_calibration_id ?? '';
  return <Panel name="history" title="Active calibrations">
    <Problem text={loaded.problem} />
    {history.length === 0 && !loaded.loading && loaded.problem === '' && <p class="empty">No calibration of {rig} has been active yet.</p>}
    {history.length > 0 && <div class="scroll" tabIndex={0} role="region" aria-label="History of the active calibration"><table>
      <thead><tr><th scope="col">calibration</th><th scope="col">since</th><th scope="col">by</th><th scope="col">why</th></tr></thead>
      <tbody>{history.slice(0, 50).map((one, i) => <tr key={one.number}>
        <th scope="row"><a href={hashOf('result', one.calibration_id)}>{one.calibration_id}</a></th>
        <td>{dateTime(timeMs(one.time))}{i === 0 && <> <Chip mark={stale ? 'idle' : 'good'}>active</Chip></>}</td><td>{who(one)}</td>
        <td class="words">{[one.rollback ? 'rolled back' : '', one.forced ? '▲ against the refusal' : '', one.reason].filter(Boolean).join(', ')}</td></tr>)}</tbody>
    </table></div>}
    {before !== '' && <div class="buttons"><Overrulable disabled={stale} verb={`Roll back to ${before}`} anyway={`Roll back to ${before} nevertheless`} work={async (force) => {
      await rollbackRig(rig, '', force);
      loaded.reload();
      onChange();
    }} /></div>}
  </Panel>;
}
