// SPDX-License-Identifier: Apache-2.0
// Start and stop, with the settings of a session.
import type { JSX } from 'preact';
import { useState } from 'preact/hooks';
import { timeMs, toCount, toDuration } from '../api/json_values';
import { createCalibration, createSession, discardSession, listAgents, resumeSession, startSession, stopSession } from '../api/server_api';
import type { Session } from '../api/types';
import { Chip, type Mark, Problem, WorkButton } from '../shell/parts';
import { hashOf } from '../shell/route';
import { changeSettings, readSettings } from '../shell/settings';
import { useLoaded } from '../shell/use_async';
import type { RigState } from '../live/live_merge';
import { count, span } from '../view/format';
import { fieldsOf, fieldsOfText, type TargetFields, targetOf, usualBoard, usualFields } from '../view/target_text';

const states: Record<string, readonly [Mark, string]> = {
  STATE_CREATED: ['idle', 'created'], STATE_CAPTURING: ['live', 'capturing'], STATE_DRAINING: ['warn', 'draining'],
  STATE_FINISHED: ['good', 'finished'],
};

/** Symbol and word of a session's state. */
export function sessionState(session: Session | undefined): readonly [Mark, string] {
  if (session?.discard_time) return ['idle', 'thrown away'];
  return states[session?.state ?? ''] ?? ['idle', 'none'];
}

/** A number that may be left out; NaN where it is not one, or not positive. */
export function optionalPositive(text: string): number | undefined {
  const trimmed = text.trim().replace(',', '.');
  if (trimmed === '') return undefined;
  const value = Number(trimmed);
  return Number.isFinite(value) && value > 0 ? value : NaN;
}

/** What of the settings is a target: that of the last start here, else that of the rig's session, else the usual wand. */
export function startFields(session: Session | undefined): TargetFields {
  const stored = readSettings();
  if (stored.targetKind === 'wand' || stored.targetKind === 'rigid' || stored.targetKind === 'point' || stored.targetKind === 'board') {
    return { kind: stored.targetKind, markers: stored.markers, diameter: stored.diameter, hz: stored.blinkHz,
      tolerance: stored.tolerance, points: stored.points, board: stored.board || usualBoard };
  }
  return fieldsOf(session?.target) ?? usualFields;
}

/** Names of the cameras that could take part in a session now. */
export function usableCameras(rig: RigState): string[] {
  return rig.cameras.filter((camera) => camera.state !== 'STATE_OFFLINE').map((camera) => camera.camera ?? '');
}

/** What to do where no camera is connected. */
export function NoCameras(): JSX.Element {
  return <p class="nocameras"><Chip mark="warn">No camera is connected</Chip> Start <code>rigcal-agent</code> on the PC with the cameras;
    they appear here by themselves. <a href={hashOf('join')}>Connect a PC</a> has the command for a new one.</p>;
}

const kinds: readonly (readonly [TargetFields['kind'], string])[] = [['wand', 'Wand'], ['rigid', 'Rigid target'], ['point', 'Single marker'], ['board', 'Printed board']];

/** The fields of a target. A text of the command line that is pasted into the first one fills all. */
function TargetForm({ fields, onChange, disabled, invalid, eventCameras }: {
  fields: TargetFields; onChange: (fields: TargetFields) => void; disabled: boolean; invalid: boolean; eventCameras: readonly string[];
}): JSX.Element {
  const set = (name: keyof TargetFields) => (event: { currentTarget: { value: string } }) => onChange({ ...fields, [name]: event.currentTarget.value });
  const readFile = async (file: File | undefined): Promise<void> => {
    if (file) onChange({ ...fields, points: (await file.text()).slice(0, 20000) });
  };
  const common = { disabled, spellcheck: false, autocomplete: 'off', 'aria-describedby': 'target-problem' } as const;
  return <>
    <label class="wide">Target<select value={fields.kind} disabled={disabled} onChange={set('kind')}>
      {kinds.map(([kind, word]) => <option key={kind} value={kind}>{word}</option>)}</select></label>
    {fields.kind === 'wand' && <label class="wide">Markers along the wand, m
      <input value={fields.markers} {...common} inputMode="text" aria-invalid={invalid}
        onInput={(event) => onChange(fieldsOfText(event.currentTarget.value) ?? { ...fields, markers: event.currentTarget.value })} /></label>}
    {fields.kind === 'rigid' && <>
      <label class="wide">Points: label x y z sigma, m, a line for each
        <textarea rows={5} value={fields.points} {...common} aria-invalid={invalid} placeholder={'A1 0 0 0 0.0002\nA2 0.3 0 0.01 0.0002'} onInput={set('points')} /></label>
      <label class="wide">Or from a file<input type="file" accept=".txt,.csv,text/plain" disabled={disabled}
        onChange={(event) => void readFile(event.currentTarget.files?.[0])} /></label>
      <p class="hint wide">Detectors find wands only: the points of a rigid target come from marker files or another program.</p></>}
    {fields.kind === 'board' && <>
      <label class="wide">Board: kind, counts, metres
        <input value={fields.board} {...common} aria-invalid={invalid} onInput={set('board')} /></label>
      <p class="hint wide">Cameras without a lens can take part: page <a href={hashOf('lens')}>Lens</a> makes it from the recording.</p></>}
    {fields.kind !== 'board' && <><label>Marker diameter, m
      <input value={fields.diameter} {...common} inputMode="decimal" placeholder="not known" onInput={set('diameter')} /></label>
    <label>Blink frequency, Hz
      <input value={fields.hz} {...common} inputMode="text" placeholder="does not blink" onInput={set('hz')} /></label></>}
    {fields.kind !== 'board' && fields.hz.trim() === '' && eventCameras.length > 0 && <p class="wide why"><Chip mark="warn">{eventCameras[0]}</Chip> is an event
      camera: it finds the wand by its blink frequency. Without it, the agent assumes one.</p>}
  </>;
}

/** Settings of the next session, and the button that starts it. */
function StartForm({ rig, stale, onStarted }: { rig: RigState; stale: boolean; onStarted: () => void }): JSX.Element {
  const stored = readSettings();
  const [fields, setFields] = useState(() => startFields(rig.session));
  const [untilMm, setUntilMm] = useState(stored.untilMm);
  const [minSeconds, setMinSeconds] = useState(stored.minSeconds);
  const [title, setTitle] = useState('');
  const [goOn, setGoOn] = useState(false);
  const [without, setWithout] = useState<ReadonlySet<string>>(new Set());
  const agents = useLoaded('sensors', (signal) => listAgents(signal), 15000);
  const parsed = targetOf(fields);
  const until = optionalPositive(untilMm);
  const least = optionalPositive(minSeconds);
  const before = rig.session?.state === 'STATE_FINISHED' && !rig.session.discard_time ? rig.session : undefined;
  const usable = usableCameras(rig);
  const chosen = usable.filter((name) => !without.has(name));
  const sensors = new Map((agents.value?.agents ?? []).flatMap((agent) => agent.cameras ?? []).map((camera) => [camera.camera ?? '', camera.sensor]));
  // Its expected error is not estimated while it is waved.
  const noGoal = (fields.kind === 'rigid' || fields.kind === 'board') && !goOn;
  const start = async (): Promise<void> => {
    if (!parsed.target) throw new Error(parsed.problem);
    if (Number.isNaN(until)) throw new Error('The goal is a number of millimetres, or empty.');
    if (Number.isNaN(least)) throw new Error('The shortest time is a number of seconds, or empty.');
    changeSettings({ targetKind: fields.kind, markers: fields.markers, diameter: fields.diameter, blinkHz: fields.hz,
      tolerance: fields.tolerance, points: fields.points, board: fields.board, untilMm, minSeconds });
    const session = await createSession({ rig: rig.rig || undefined, title: title || undefined,
      target: goOn && before?.target ? before.target : parsed.target,
      goal: until && !noGoal ? { until_mm: until, ...(least ? { min_duration: toDuration(least) } : {}) } : undefined,
      // Without a choice those that are connected at the start take part.
      camera_names: chosen.length < usable.length ? chosen : undefined,
      continues: goOn ? before?.id : undefined });
    await startSession(session.id ?? '');
    onStarted();
  };
  return <div class="start">
    {usable.length === 0 && !stale && <NoCameras />}
    <div class="fields">
      <TargetForm fields={fields} onChange={setFields} disabled={goOn} invalid={!parsed.target}
        eventCameras={chosen.filter((name) => sensors.get(name) === 'SENSOR_EVENT')} />
      <label>Goal: stop below, mm
        <input value={noGoal ? '' : untilMm} inputMode="decimal" disabled={noGoal} onInput={(event) => setUntilMm(event.currentTarget.value)}
          placeholder="by hand" aria-invalid={Number.isNaN(until)} /></label>
      <label>Not before, s
        <input value={noGoal ? '' : minSeconds} inputMode="decimal" disabled={noGoal} onInput={(event) => setMinSeconds(event.currentTarget.value)}
          placeholder={noGoal ? '' : '20'} aria-invalid={Number.isNaN(least)} /></label>
      <label class="wide">Title
        <input value={title} maxLength={60} onInput={(event) => setTitle(event.currentTarget.value)} placeholder="optional" /></label>
      {before && <label class="check wide"><input type="checkbox" checked={goOn}
        onChange={(event) => setGoOn(event.currentTarget.checked)} /> Go on with {before.id}: its recording counts, too</label>}
    </div>
    {usable.length > 0 && <details class="cameras"><summary>Cameras: {chosen.length === usable.length ? `all ${usable.length}`
      : `${chosen.length} of ${usable.length}`}</summary>
      <div class="choices">{usable.map((name) => <label key={name} class="check"><input type="checkbox" checked={!without.has(name)}
        onChange={(event) => {
          const next = new Set(without);
          if (event.currentTarget.checked) next.delete(name);
          else next.add(name);
          setWithout(next);
        }} /> {name}</label>)}</div></details>}
    <div id="target-problem"><Problem text={goOn ? '' : parsed.problem} /></div>
    {usable.length > 0 && <WorkButton kind="primary" work={start} disabled={stale || !parsed.target || chosen.length === 0}>Start capture</WorkButton>}
    {usable.length > 0 && chosen.length === 0 && <p class="hint">No camera is chosen.</p>}
  </div>;
}

/** The session of the rig: state, start, stop, and what follows. */
export function SessionControls({ rig, stale, onChange }: {
  rig: RigState; stale: boolean; onChange: () => void;
}): JSX.Element {
  const [again, setAgain] = useState(false);
  const session = rig.session;
  const [mark, word] = sessionState(session);
  const started = timeMs(session?.start_time);
  const ended = timeMs(session?.stop_time ?? session?.finish_time) ?? timeMs(rig.time);
  const running = session?.state === 'STATE_CAPTURING';
  const discarded = Boolean(session?.discard_time);
  const finished = session?.state === 'STATE_FINISHED' && !discarded;
  const settings = !session || discarded || again;
  const usable = usableCameras(rig);
  // Cameras that were described by hand need no agent.
  const canStart = usable.length > 0 || (session?.cameras ?? []).length > 0;
  return <div class="session">
    {session && <p class="line"><Chip mark={stale ? 'idle' : mark}>{stale ? 'not known' : word}</Chip>
      <span class="strong">{session.id}</span>{session.title && <span>{session.title}</span>}
      {started !== undefined && ended !== undefined && <span>{stale ? '' : span((ended - started) / 1000)}</span>}
      <span class="end">{count(toCount(session.wand_count))} with wand</span></p>}
    {session?.stop_reason && <p class="line">Stopped by itself: {session.stop_reason}.</p>}
    {stale && <p class="hint">Not known while the server does not answer. Cameras that captured go on; their agents keep what they see.</p>}
    {running && <WorkButton kind="danger" disabled={stale} work={async () => {
      setAgain(false);
      await stopSession(session.id ?? '');
      onChange();
    }}>■ Stop capture</WorkButton>}
    {session?.state === 'STATE_DRAINING' && <p class="hint">Waiting for what is still on its way from the agents.</p>}
    {session?.state === 'STATE_CREATED' && !discarded && !again && (!canStart ? !stale && <NoCameras />
      : <div class="buttons"><WorkButton kind="primary" disabled={stale} work={async () => {
        await startSession(session.id ?? '');
        onChange();
      }}>Start {session.id}</WorkButton></div>)}
    {finished && !again && <div class="buttons">
      <WorkButton kind="primary" disabled={stale} work={async () => {
        const calibration = await createCalibration([session.id ?? '']);
        location.hash = hashOf('result', calibration.id);
      }}>Calibrate</WorkButton>
      <WorkButton disabled={stale || usable.length === 0} work={async () => {
        await resumeSession(session.id ?? '');
        onChange();
      }}>Resume</WorkButton>
      <button type="button" onClick={() => setAgain(true)}>New capture</button>
      <WorkButton kind="quiet" disabled={stale} work={async () => {
        await discardSession(session.id ?? '');
        onChange();
      }}>Throw away</WorkButton>
    </div>}
    {discarded && <div class="buttons"><span class="hint">Nothing of it is deleted.</span>
      <WorkButton kind="quiet" disabled={stale} work={async () => {
        await discardSession(session?.id ?? '', true);
        onChange();
      }}>Take it back</WorkButton></div>}
    {session?.state === 'STATE_CREATED' && !discarded && !again &&
      <button type="button" class="quiet" onClick={() => setAgain(true)}>Another session</button>}
    {settings && !running && <StartForm rig={rig} stale={stale} onStarted={() => {
      setAgain(false);
      onChange();
    }} />}
  </div>;
}
