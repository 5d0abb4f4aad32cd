// SPDX-License-Identifier: Apache-2.0
// Floor, origin and axes: a new calibration of this one in another frame.
import type { ComponentChildren, JSX } from 'preact';
import { useEffect, useState } from 'preact/hooks';
import { timeMs } from '../api/json_values';
import { createCalibration, createSession, listSessions, startSession, stopSession } from '../api/server_api';
import type { Calibration, CalibrationFrame, OriginOptions } from '../api/types';
import { useFeed, useFeedControl } from '../shell/feed_context';
import { Chip, Panel, Problem, WorkButton } from '../shell/parts';
import { hashOf } from '../shell/route';
import { useLoaded } from '../shell/use_async';
import { dateTime, fixed, millimetres, span } from '../view/format';
import { parsePoints } from '../view/target_text';
import { filterText } from '../records/filter';

const sources: Record<string, string> = {
  FRAME_SOURCE_FLOOR: 'z = 0 is the floor, z up', FRAME_SOURCE_POINTS: 'that of known points', FRAME_SOURCE_PATH: 'z = 0 is the plane of a path',
  FRAME_SOURCE_DOWN: 'z up, against a given direction', FRAME_SOURCE_TRANSFORM: 'as given', FRAME_SOURCE_KEPT: 'that of an earlier calibration, kept',
};

/** Which frame a calibration is in, in a few words. */
export function frameName(calibration: Calibration): string {
  return sources[calibration.frame?.source ?? ''] ?? `that of ${calibration.reference_camera ?? ''}`;
}

/** Where the frame of a calibration comes from, with its figures. */
export function frameText(calibration: Calibration): string {
  const frame: CalibrationFrame | undefined = calibration.frame;
  if (!frame || !sources[frame.source ?? '']) return [frameName(calibration), frame?.problem ?? ''].filter(Boolean).join(': ');
  return [frameName(calibration), frame.calibration_id ? `from ${frame.calibration_id}` : '',
    frame.residual_rms_m ? `residuals ${millimetres(frame.residual_rms_m * 1e3)} mm rms` : '',
    frame.lowest_camera ? `lowest camera ${frame.lowest_camera} at ${fixed(frame.lowest_camera_m ?? 0, 2)} m` : ''].filter(Boolean).join(', ');
}

type Way = 'floor' | 'points' | 'path' | 'down' | 'transform';
const ways: readonly (readonly [Way, string])[] = [
  ['floor', 'Floor: the wand lies on it'], ['points', 'Points of known coordinates'], ['path', 'A path in one plane'],
  ['down', 'Direction of gravity'], ['transform', 'Numbers'],
];
const withRows: readonly Way[] = ['floor', 'points', 'path'];

/** So many finite numbers; undefined where the text has others. */
export function exactly(text: string, wanted: number): number[] | undefined {
  const values = text.trim().split(/[\s,]+/).filter(Boolean).map(Number);
  return values.length === wanted && values.every(Number.isFinite) ? values : undefined;
}

/** What is asked for; throws where a field is wrong. */
export function originOptions(way: Way, fields: { height: string; points: string; numbers: string }): OriginOptions {
  const height = fields.height.trim() === '' ? 0 : Number(fields.height.trim().replace(',', '.'));
  if (!Number.isFinite(height) || Math.abs(height) > 10) throw new Error('The height is a number of metres, such as 0.02.');
  if (way === 'floor') return { source: 'FRAME_SOURCE_FLOOR', height_m: height };
  if (way === 'path') return { source: 'FRAME_SOURCE_PATH', height_m: height };
  if (way === 'points') {
    const { points, problem } = parsePoints(fields.points);
    if (problem !== '') throw new Error(problem);
    if (points.length < 3) throw new Error('Give three points or more, a line for each: label x y z, in metres.');
    return { source: 'FRAME_SOURCE_POINTS', points: points.map((one) => ({ label: one.label, sigma_m: one.sigma_m,
      position_m: { x: one.x_m, y: one.y_m, z: one.z_m } })) };
  }
  if (way === 'down') {
    const down = exactly(fields.numbers, 3);
    if (!down || Math.hypot(...down) === 0) throw new Error('Down is a direction of three numbers in the present frame: 0, 1, 0');
    return { source: 'FRAME_SOURCE_DOWN', down: { x: down[0], y: down[1], z: down[2] } };
  }
  const values = exactly(fields.numbers, 7);
  if (!values) throw new Error('Give seven numbers: X, Y, Z in metres and the quaternion QW, QX, QY, QZ of new_from_rig.');
  const [x, y, z, qw, qx, qy, qz] = values;
  return { source: 'FRAME_SOURCE_TRANSFORM', new_from_rig: { translation_m: { x, y, z }, rotation: { w: qw, x: qx, y: qy, z: qz } } };
}

/** Records the wand while it lies still, or waits for what is recorded. */
function Recording({ calibration, session, onSession, what }: {
  calibration: Calibration; session: string; onSession: (id: string) => void; what: ComponentChildren;
}): JSX.Element {
  const feed = useFeedControl();
  const { rig, stale } = useFeed();
  const live = rig.session?.id === session && session !== '' ? rig.session : undefined;
  const busy = rig.session?.state === 'STATE_CAPTURING' || rig.session?.state === 'STATE_DRAINING';
  const capturing = live?.state === 'STATE_CAPTURING';
  const started = timeMs(live?.start_time);
  const now = timeMs(rig.time);
  useEffect(() => {
    if (!capturing) return undefined;
    feed.setAttention('wave');
    return () => feed.setAttention('other');
  }, [capturing, feed]);
  const list = useLoaded(`finished ${calibration.rig} ${live?.state ?? ''}`, (signal) =>
    listSessions({ filter: filterText({ rig: calibration.rig ?? '', state: 'STATE_FINISHED' }), page_size: 50 }, signal), 5000);
  const finished = (list.value?.sessions ?? []).filter((one) => !one.discard_time && !one.observations_delete_time);
  if (capturing) {
    return <><p class="line"><Chip mark={stale ? 'idle' : 'live'}>{stale ? 'not known' : 'recording'}</Chip> <b>{live?.id}</b>
      {started !== undefined && now !== undefined && !stale && <span>{span((now - started) / 1000)}</span>}</p>
      <p>{what}</p>
      <WorkButton kind="danger" disabled={stale} work={async () => {
        await stopSession(session);
        feed.retryNow();
      }}>■ Stop recording</WorkButton></>;
  }
  return <>
    <p class="hint">{what}</p>
    <div class="fields"><label>Recording <select value={session} onChange={(event) => onSession(event.currentTarget.value)}>
      <option value="">none yet</option>
      {session !== '' && !finished.some((one) => one.id === session) && <option value={session}>{session} …</option>}
      {finished.map((one) => <option key={one.id} value={one.id}>{[one.id, one.title, dateTime(timeMs(one.stop_time ?? one.finish_time))].filter(Boolean).join(' · ')}</option>)}
    </select></label></div>
    <Problem text={list.problem} />
    <div class="buttons"><WorkButton disabled={stale || busy || rig.rig !== calibration.rig} work={async () => {
      const made = await createSession({ rig: calibration.rig, title: 'floor', target: calibration.target?.given });
      await startSession(made.id ?? '');
      onSession(made.id ?? '');
      feed.retryNow();
    }}>● Record now</WorkButton>
    {busy && !live && <span class="hint">{rig.session?.id} is being captured.</span>}
    {live?.state === 'STATE_DRAINING' && <span class="hint">Waiting for what is still on its way.</span>}</div>
  </>;
}

const explained: Record<Way, string> = {
  floor: 'Lay the wand down at three places well apart, each time in another direction, and let it lie for two seconds. The origin is below its first marker at the first place, x along the wand there.',
  points: 'Lines: label x y z sigma, in metres. Marker m of the recording is line m, or the line with its label; let the target rest for two seconds. Without a recording they are static points of this calibration.',
  path: 'Move the wand in one plane, such as on a table. The plane becomes z = 0, with the cameras above it.',
  down: 'Three numbers in the present frame: the direction in which things fall. The origin stays.',
  transform: 'new_from_rig: X, Y, Z in metres, then the quaternion QW, QX, QY, QZ.',
};

/** Sets the floor, or another origin and axes. */
export function FramePanel({ calibration }: { calibration: Calibration }): JSX.Element {
  const [way, setWay] = useState<Way>('floor');
  const [session, setSession] = useState('');
  const diameter = calibration.target?.given?.diameter_m ?? 0;
  const [height, setHeight] = useState(diameter > 0 ? String(Number((diameter / 2).toFixed(4))) : '');
  const [points, setPoints] = useState('');
  const [numbers, setNumbers] = useState('');
  const { rig, stale } = useFeed();
  const rows = withRows.includes(way);
  const waits = rig.session?.id === session && (rig.session.state === 'STATE_CAPTURING' || rig.session.state === 'STATE_DRAINING');
  return <Panel name="frame" title="Floor and origin">
    <p>The frame is {frameText(calibration)}.</p>
    {!calibration.scale_known ? <p class="hint">It needs a known scale.</p> : <>
      <label>New frame from <select value={way} onChange={(event) => setWay(event.currentTarget.value as Way)}>
        {ways.map(([value, word]) => <option key={value} value={value}>{word}</option>)}</select></label>
      {rows ? <Recording calibration={calibration} session={session} onSession={setSession} what={explained[way]} /> : <p class="hint">{explained[way]}</p>}
      <div class="fields">
        {(way === 'floor' || way === 'path') && <label>Height of the marker centres, m
          <input value={height} inputMode="decimal" placeholder="0" onInput={(event) => setHeight(event.currentTarget.value)} /></label>}
        {way === 'points' && <label class="wide">Points<textarea rows={4} value={points} spellcheck={false} placeholder={'A 0 0 0\nB 0.3 0 0\nC 0 0.2 0'}
          onInput={(event) => setPoints(event.currentTarget.value)} /></label>}
        {(way === 'down' || way === 'transform') && <label class="wide">Numbers<input value={numbers} spellcheck={false}
          placeholder={way === 'down' ? '0, 1, 0' : '0, 0, 0, 1, 0, 0, 0'} onInput={(event) => setNumbers(event.currentTarget.value)} /></label>}
      </div>
      <div class="buttons"><WorkButton kind="primary" disabled={stale || (rows && (waits || (session === '' && way !== 'points')))} work={async () => {
        const origin = originOptions(way, { height, points, numbers });
        const made = await createCalibration(rows && session !== '' ? [session] : [], { kind: 'KIND_ORIGIN', parent_id: calibration.id, origin });
        location.hash = hashOf('result', made.id);
      }}>{way === 'floor' ? 'Set floor' : 'Set origin'}</WorkButton>
      <span class="hint">Makes a new calibration; this one stays as it is.</span></div>
    </>}
  </Panel>;
}
