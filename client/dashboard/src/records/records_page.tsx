// SPDX-License-Identifier: Apache-2.0
// Lists of sessions and calibrations.
import type { JSX } from 'preact';
import { useState } from 'preact/hooks';
import { timeMs, toCount } from '../api/json_values';
import { createCalibration, deleteCalibration, deleteSession, discardSession, getSession, listCalibrations, listRigs, listSessions } from '../api/server_api';
import type { Calibration, Session, SessionCamera } from '../api/types';
import { FirstOf, SearchField } from '../cameras/camera_list';
import { fewCameras } from '../cameras/camera_needs';
import { useFeedControl } from '../shell/feed_context';
import { Chip, Confirm, Panel, Problem, WorkButton } from '../shell/parts';
import { hashOf, type Route } from '../shell/route';
import { useLoaded } from '../shell/use_async';
import { calibrationMark } from '../result/grade';
import { calibrationSpan } from '../result/result_page';
import { named } from '../result/worst_first';
import { count, dateTime, fixed, missing, span } from '../view/format';
import { targetText } from '../view/target_text';
import { sessionState } from '../wave/session_controls';
import { filterText, matches } from './filter';

/** What is asked before it is deleted. */
interface Deletion {
  kind: 'session' | 'calibration';
  id: string;
}

function sessionSpan(session: Session): string {
  const [from, to] = [timeMs(session.start_time), timeMs(session.stop_time ?? session.finish_time)];
  return from === undefined || to === undefined ? missing : span((to - from) / 1000);
}

/** Of many cameras, those that have not ended or have no wand come first. */
function SessionCameras({ cameras }: { cameras: readonly SessionCamera[] }): JSX.Element {
  const [text, setText] = useState('');
  const many = cameras.length > fewCameras;
  const lacking = (camera: SessionCamera): number => (camera.ended ? 0 : 2) + (toCount(camera.wand_count) === 0 ? 1 : 0);
  const shown = !many ? cameras : named([...cameras].sort((a, b) => lacking(b) - lacking(a)),
    (camera) => `${camera.description?.camera ?? ''} ${camera.agent_id ?? ''}`, text);
  return <>
    {many && <p class="summary">{cameras.length} cameras, {cameras.filter((camera) => camera.ended).length} of them have ended, {
      cameras.filter((camera) => toCount(camera.wand_count) > 0).length} have seen the wand</p>}
    {many && <SearchField text={text} label="Find a camera or an agent" onChange={setText} />}
    <FirstOf items={shown} step={fewCameras}>{(first) => <div class="scroll" tabIndex={0} role="region" aria-label="Cameras of the session"><table>
      <thead><tr><th scope="col">camera</th><th scope="col">agent</th><th scope="col">observations</th><th scope="col">with wand</th><th scope="col">ended</th></tr></thead>
      <tbody>{first.map((camera) => <tr key={camera.description?.camera}><th scope="row">{camera.description?.camera}</th>
        <td>{camera.agent_id}</td><td>{count(toCount(camera.observation_count))}</td><td>{count(toCount(camera.wand_count))}</td>
        <td>{camera.ended ? '✓ yes' : '○ no'}</td></tr>)}</tbody></table></div>}</FirstOf>
  </>;
}

/** The names of a few, and how many more there are. */
function fewNames(names: readonly string[]): string {
  const more = names.length - fewCameras;
  return more > 0 ? `${names.slice(0, fewCameras).join(', ')} and ${more} more` : names.join(', ');
}

function SessionDetail({ id }: { id: string }): JSX.Element {
  const loaded = useLoaded(`session ${id}`, (signal) => getSession(id, signal));
  const session = loaded.value;
  return <Panel name="detail" title={`Session ${id}`} aside={<a class="button" href={hashOf('records')}>Close</a>}>
    <Problem text={loaded.problem} />
    {session && <>
      <dl class="facts">
        <div class="fact"><dt>state</dt><dd>{sessionState(session)[1]}</dd></div>
        <div class="fact"><dt>target</dt><dd>{targetText(session.target)}</dd></div>
        <div class="fact"><dt>started</dt><dd>{dateTime(timeMs(session.start_time))}</dd></div>
        <div class="fact"><dt>lasted</dt><dd>{sessionSpan(session)}</dd></div>
        {session.goal?.until_mm && <div class="fact"><dt>goal</dt><dd>{fixed(session.goal.until_mm, 2)} mm</dd></div>}
        {session.discard_time && <div class="fact"><dt>thrown away</dt><dd>{dateTime(timeMs(session.discard_time))}; nothing is deleted</dd></div>}
        {session.stop_reason && <div class="fact"><dt>stopped</dt><dd>{session.stop_reason}</dd></div>}
        {session.continues && <div class="fact"><dt>continues</dt><dd><a href={hashOf('records', session.continues)}>{session.continues}</a></dd></div>}
        {toCount(session.late_count) > 0 && <div class="fact"><dt>late, not used</dt><dd>{count(toCount(session.late_count))}</dd></div>}
      </dl>
      {!!session.missing_cameras?.length && <p class="problem">✕ Had not ended: {fewNames(session.missing_cameras)}</p>}
      {!!session.cameras?.length && <SessionCameras cameras={session.cameras} />}
    </>}
  </Panel>;
}

/** Sessions and calibrations: find, open, calibrate, delete. */
export function RecordsPage({ route }: { route: Route }): JSX.Element {
  const feed = useFeedControl();
  const [text, setText] = useState('');
  const [sessionFilter, setSessionFilter] = useState('');
  const [calibrationFilter, setCalibrationFilter] = useState('');
  const [chosen, setChosen] = useState<ReadonlySet<string>>(new Set());
  const [deletion, setDeletion] = useState<Deletion>();
  const [size, setSize] = useState({ sessions: 50, calibrations: 50 });
  const sessions = useLoaded(`sessions ${sessionFilter} ${size.sessions}`, (signal) =>
    listSessions({ filter: filterText({ state: sessionFilter }), page_size: size.sessions }, signal), 5000);
  const calibrations = useLoaded(`calibrations ${calibrationFilter} ${size.calibrations}`, (signal) =>
    listCalibrations({ filter: filterText({ state: calibrationFilter }), page_size: size.calibrations }, signal), 5000);
  const rigs = useLoaded('active', (signal) => listRigs(signal), 10000);
  const active = new Set((rigs.value?.rigs ?? []).map((one) => one.active_calibration_id).filter(Boolean));
  const shownSessions = (sessions.value?.sessions ?? []).filter((one) => matches(text, [one.id, one.title, one.rig, targetText(one.target)]));
  const shownCalibrations = (calibrations.value?.calibrations ?? []).filter((one) => matches(text, [one.id, one.rig, ...(one.session_ids ?? [])]));
  const usable = [...chosen].filter((id) => shownSessions.some((one) => one.id === id && one.state === 'STATE_FINISHED' && !one.discard_time));
  const choose = (id: string, on: boolean) => {
    const next = new Set(chosen);
    if (on) next.add(id);
    else next.delete(id);
    setChosen(next);
  };
  const select = (label: string, value: string, set: (value: string) => void, options: readonly (readonly [string, string])[]) =>
    <label>{label} <select value={value} onChange={(event) => set(event.currentTarget.value)}>
      <option value="">all</option>{options.map(([name, word]) => <option key={name} value={name}>{word}</option>)}</select></label>;
  return <div class="records">
    <div class="bar">
      <label>Find <input type="search" value={text} placeholder="id, title, rig" onInput={(event) => setText(event.currentTarget.value)} /></label>
    </div>
    {route.id !== '' && <SessionDetail id={route.id} />}
    <Panel name="sessions" title="Sessions" aside={select('State', sessionFilter, setSessionFilter, [['STATE_CREATED', 'created'],
      ['STATE_CAPTURING', 'capturing'], ['STATE_DRAINING', 'draining'], ['STATE_FINISHED', 'finished']])}>
      <Problem text={sessions.problem} />
      <div class="buttons"><WorkButton kind="primary" disabled={usable.length === 0} work={async () => {
        const calibration = await createCalibration(usable.sort());
        location.hash = hashOf('result', calibration.id);
      }}>{usable.length > 1 ? `Calibrate from ${usable.length} sessions` : 'Calibrate'}</WorkButton>
      <span class="hint">{usable.length === 0 ? 'Select finished sessions.' : usable.join(', ')}</span></div>
      <div class="scroll" tabIndex={0} role="region" aria-label="Sessions"><table>
        <thead><tr><td /><th scope="col">session</th><th scope="col">title</th><th scope="col">state</th><th scope="col">rig</th><th scope="col">created</th>
          <th scope="col">lasted</th><th scope="col">cameras</th><th scope="col">with wand</th><td /></tr></thead>
        <tbody>{shownSessions.map((session) => {
          const id = session.id ?? '';
          const [mark, word] = sessionState(session);
          const busy = session.state === 'STATE_CAPTURING' || session.state === 'STATE_DRAINING';
          return <tr key={id}>
            <td><input type="checkbox" aria-label={`Select ${id}`} checked={chosen.has(id)} disabled={session.state !== 'STATE_FINISHED' || Boolean(session.discard_time)}
              onChange={(event) => choose(id, event.currentTarget.checked)} /></td>
            <th scope="row"><a href={hashOf('records', id)}>{id}</a></th><td class="words">{session.title}{session.damage && <span class="problem">✕ {session.damage}</span>}</td>
            <td><Chip mark={mark}>{word}</Chip></td><td>{session.rig}</td><td>{dateTime(timeMs(session.create_time))}</td><td>{sessionSpan(session)}</td>
            <td>{session.camera_count ?? session.cameras?.length ?? 0}</td>
            <td>{session.observations_delete_time ? 'deleted' : count(toCount(session.wand_count))}</td>
            <td><WorkButton kind="quiet" disabled={busy} label={`${session.discard_time ? 'Take back' : 'Throw away'} ${id}`} work={async () => {
              await discardSession(id, Boolean(session.discard_time));
              sessions.reload();
            }}>{session.discard_time ? 'Take back' : 'Throw away'}</WorkButton>
              <button type="button" class="quiet" disabled={busy} aria-label={`Delete ${id}`} onClick={() => setDeletion({ kind: 'session', id })}>Delete</button></td></tr>;
        })}</tbody></table></div>
      {shownSessions.length === 0 && !sessions.loading && <p class="empty">No session here.</p>}
      {sessions.value?.next_page_token && size.sessions < 1000 &&
        <button type="button" onClick={() => setSize({ ...size, sessions: Math.min(1000, size.sessions * 4) })}>More</button>}
    </Panel>
    <Panel name="calibrations" title="Calibrations" aside={select('State', calibrationFilter, setCalibrationFilter, [['STATE_QUEUED', 'queued'],
      ['STATE_RUNNING', 'running'], ['STATE_SUCCEEDED', 'succeeded'], ['STATE_FAILED', 'failed'], ['STATE_CANCELLED', 'cancelled']])}>
      <Problem text={calibrations.problem} />
      <div class="scroll" tabIndex={0} role="region" aria-label="Calibrations"><table>
        <thead><tr><th scope="col">calibration</th><th scope="col">grade</th><th scope="col">rig</th><th scope="col">version</th><th scope="col">made</th>
          <th scope="col">sessions</th><th scope="col">instants</th><th scope="col">solved in</th><td /></tr></thead>
        <tbody>{shownCalibrations.map((one: Calibration) => {
          const id = one.id ?? '';
          const [mark, word] = calibrationMark(one);
          const busy = one.state === 'STATE_QUEUED' || one.state === 'STATE_RUNNING';
          return <tr key={id}><th scope="row"><a href={hashOf('result', id)}>{id}</a></th><td><Chip mark={mark}>{word}</Chip>{active.has(one.id) && <> <Chip mark="good">active</Chip></>}</td><td>{one.rig}</td>
            <td>{one.version}</td><td>{dateTime(timeMs(one.run?.create_time))}</td><td class="words">{(one.session_ids ?? []).join(', ')}</td>
            <td>{count(one.instant_count)}</td><td>{calibrationSpan(one)}</td>
            <td><button type="button" class="quiet" disabled={busy} aria-label={`Delete ${id}`} onClick={() => setDeletion({ kind: 'calibration', id })}>Delete</button></td></tr>;
        })}</tbody></table></div>
      {shownCalibrations.length === 0 && !calibrations.loading && <p class="empty">No calibration here.</p>}
      {calibrations.value?.next_page_token && size.calibrations < 1000 &&
        <button type="button" onClick={() => setSize({ ...size, calibrations: Math.min(1000, size.calibrations * 4) })}>More</button>}
    </Panel>
    {deletion && <Confirm question={`Delete ${deletion.kind} ${deletion.id}?`} verb="Delete"
      detail={deletion.kind === 'session' ? 'Its observations are deleted from the server and cannot be brought back. Calibrations made from it stay.'
        : 'It is deleted from the server. Its sessions stay; its number is not used again.'}
      onYes={async () => {
        if (deletion.kind === 'session') {
          await deleteSession(deletion.id);
          feed.askAnew();
        } else await deleteCalibration(deletion.id);
        if (route.id === deletion.id) location.hash = hashOf('records');
        sessions.reload();
        calibrations.reload();
      }} onClose={() => setDeletion(undefined)} />}
  </div>;
}
