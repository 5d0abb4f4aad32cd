// SPDX-License-Identifier: Apache-2.0
import type { JSX } from 'preact';
import { memo } from './memo';
import { useCallback, useRef, useState } from 'preact/hooks';
import { toCount } from '../api/json_values';
import type { LiveAlert, LiveCamera } from '../api/types';
import { PreviewImage } from '../rig/preview';
import { Canvas } from '../shell/canvas';
import { Chip, type Mark, Meter } from '../shell/parts';
import { count, fixed, missing, percent } from '../view/format';
import { drawTile } from './draw_tile';

const states: Record<string, readonly [Mark, string]> = {
  STATE_OFFLINE: ['bad', 'offline'], STATE_IDLE: ['idle', 'idle'], STATE_CAPTURING: ['live', 'capturing'],
  STATE_ENDED: ['good', 'ended'],
};

/** Symbol and word of a camera's state. */
export function cameraState(camera: LiveCamera): readonly [Mark, string] {
  return states[camera.state ?? ''] ?? ['idle', 'unknown'];
}

/** Symbol of an alert's severity. */
export function alertMark(alert: LiveAlert): Mark {
  return alert.severity === 'SEVERITY_ERROR' ? 'bad' : alert.severity === 'SEVERITY_WARNING' ? 'warn' : 'info';
}

const short: Record<string, string> = { no_wand: 'no wand', two_wands: 'two wands', clock_off: 'clock off' };

interface Props {
  camera: LiveCamera;
  alert: LiveAlert | undefined;
  stale: boolean;
  theme: string;
  /** The rig, where its pictures are wanted; '': they are not. */
  pictures: string;
  /** Session and state; a change lets a camera without pictures be asked again. */
  state: string;
}

/** What the camera sees, below its coverage. */
function Picture({ rig, camera, state, onShown }: {
  rig: string; camera: string; state: string; onShown: (shown: boolean) => void;
}): JSX.Element {
  const image = useRef<HTMLImageElement>(null);
  return <PreviewImage image={image} rig={rig} camera={camera} state={state} onShown={onShown} />;
}

/** A camera: where it has seen the wand, and whether all is well. */
export const CameraTile = memo(function CameraTile({ camera, alert, stale, theme, pictures, state }: Props): JSX.Element {
  const [shown, setShown] = useState(false);
  const picture = pictures !== '' && Boolean(camera.has_preview) && camera.state !== 'STATE_OFFLINE' && !stale;
  const draw = useCallback((context: CanvasRenderingContext2D, width: number, height: number) =>
    drawTile(context, camera, width, height, stale, shown), [camera, stale, theme, shown]);
  const [mark, word] = cameraState(camera);
  const share = camera.coverage?.covered_share ?? 0;
  const shared = camera.shared_instant_count ?? 0;
  const goal = camera.shared_instant_goal ?? 0;
  const backlog = toCount(camera.backlog_count);
  const dropped = toCount(camera.dropped_count);
  const rate = (value: number | undefined) => (stale ? missing : fixed(value ?? 0, 0));
  const offset = camera.clock?.time_offset_s;
  return <li class={`tile ${alert && !stale ? alertMark(alert) : ''}`}>
    <div class="head">
      <h3>{camera.camera}</h3>
      {alert && !stale ? <span title={alert.text}><Chip mark={alertMark(alert)}>{short[alert.kind ?? ''] ?? alert.kind?.replaceAll('_', ' ')}</Chip></span>
        : <Chip mark={stale ? 'idle' : mark}>{stale ? 'not known' : word}</Chip>}
    </div>
    <div class="seen">{picture && <Picture rig={pictures} camera={camera.camera ?? ''} state={`${camera.state} ${camera.agent_id} ${state}`} onShown={setShown} />}
      <Canvas draw={draw} label={`${camera.camera}: ${percent(share)} of the image covered`} /></div>
    <div class="row"><span class="strong">{percent(share)}</span><span>covered</span>
      {dropped > 0 ? <span class="end lost" title="Observations that will never arrive or were refused">✕ {count(dropped)} lost</span>
        : backlog > 0 && <span class="end" title="Observations waiting in the agent's spool">⇡ {count(backlog)} wait</span>}</div>
    {goal > 0 && <div class="row goal"><Meter share={shared / goal} label={`${camera.camera}: shared instants`} />
      <span title="Instants shared with another camera">{count(shared)}/{count(goal)}</span></div>}
    <div class="row small">
      <span title="Observations per second, and those with the wand">{rate(camera.observation_rate_hz)}/{rate(camera.wand_rate_hz)} Hz</span>
      <span title="Reprojection error in the running estimate">{camera.reprojection_rms_px ? `${fixed(camera.reprojection_rms_px, 2)} px` : '– px'}</span>
      <span title="Offset of its clock found so far">{offset === undefined ? '– ms' : `${fixed(offset * 1e3, 1)} ms`}</span>
    </div>
  </li>;
});
