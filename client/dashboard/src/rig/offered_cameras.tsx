// SPDX-License-Identifier: Apache-2.0
// Cameras that agents see on their PCs: chosen and dropped here.
import type { JSX } from 'preact';
import { useState } from 'preact/hooks';
import { dropCamera, useCamera } from '../api/server_api';
import type { Agent, OfferedCamera } from '../api/types';
import { FirstOf } from '../cameras/camera_list';
import { Chip, type Mark, Panel, WorkButton } from '../shell/parts';

const states: Record<string, [Mark, string]> = {
  USE_FREE: ['info', 'not used'], USE_TAKES_PART: ['good', 'takes part'], USE_BUSY: ['warn', 'in use by another program'],
  USE_NO_PERMISSION: ['bad', 'no permission'], USE_GONE: ['bad', 'gone'],
};

/** "FLIR Blackfly 2345": what a person reads on the camera. */
export function deviceText(camera: OfferedCamera): string {
  return [camera.vendor, camera.model, camera.device].filter(Boolean).join(' ');
}

/** Whether it can be a camera's name, as the server sees it. */
export function isCameraName(text: string): boolean {
  return /^[A-Za-z0-9_-][A-Za-z0-9_.-]{0,63}$/.test(text);
}

function UseForm({ agent, camera, stale, onDone }: {
  agent: string; camera: OfferedCamera; stale: boolean; onDone: () => void;
}): JSX.Element {
  const [name, setName] = useState('');
  const [lens, setLens] = useState<File | undefined>(undefined);
  const what = deviceText(camera);
  return <div class="use">
    <label>Name<input value={name} placeholder="left" autocomplete="off" aria-label={`Name for ${what}`}
      aria-invalid={name !== '' && !isCameraName(name)} onInput={(event) => setName(event.currentTarget.value.trim())} /></label>
    <label>Lens file, optional<input type="file" accept=".yaml,.yml" aria-label={`Lens file of ${what}`}
      onChange={(event) => setLens(event.currentTarget.files?.[0])} /></label>
    <WorkButton kind="primary" disabled={stale || !isCameraName(name)} label={`Use ${what}`} work={async () => {
      await useCamera(agent, camera.device ?? '', name, lens ? await lens.text() : '');
      onDone();
    }}>Use</WorkButton>
  </div>;
}

function OfferRow({ agent, camera, stale, onDone }: {
  agent: Agent; camera: OfferedCamera; stale: boolean; onDone: () => void;
}): JSX.Element {
  const [mark, word] = states[camera.use ?? ''] ?? ['idle', 'not known'];
  const [id, name] = [agent.agent_id ?? '', camera.camera ?? ''];
  return <li class="offer">
    <p>found on <b>{id}</b>: {deviceText(camera)}{camera.address ? `, ${camera.address}` : ''}</p>
    <p><Chip mark={stale ? 'idle' : mark}>{stale ? 'not known' : word}</Chip>{name !== '' && <> as <b>{name}</b></>}
      {camera.configured && <span class="hint"> by the agent's configuration</span>}</p>
    {camera.note && <p class="hint">{camera.note}</p>}
    {camera.use === 'USE_FREE' && name === '' && <UseForm agent={id} camera={camera} stale={stale} onDone={onDone} />}
    {name !== '' && !camera.configured && <WorkButton disabled={stale} label={`Drop ${name}`} work={async () => {
      await dropCamera(agent.rig ?? '', name);
      onDone();
    }}>Drop</WorkButton>}
  </li>;
}

/** What the connected agents see; nothing where they offer nothing. */
export function OfferedCameras({ agents, stale, onDone }: { agents: Agent[]; stale: boolean; onDone: () => void }): JSX.Element | null {
  const offers = agents.filter((agent) => agent.connected)
    .flatMap((agent) => (agent.offered ?? []).map((camera) => ({ agent, camera })));
  if (offers.length === 0) return null;
  const unused = offers.filter(({ camera }) => camera.use === 'USE_FREE' && !camera.camera).length;
  // Of many, those first for which a person can do something.
  const rank = (use: string | undefined): number => (use === 'USE_TAKES_PART' ? 1 : 0);
  const sorted = offers.length <= 16 ? offers : [...offers].sort((a, b) => rank(a.camera.use) - rank(b.camera.use));
  return <Panel name="offers" title={`Found cameras (${offers.length}, ${unused} not used)`}>
    <FirstOf items={sorted} step={16}>{(shown) => <ul class="offergrid">{shown.map(({ agent, camera }) => <OfferRow key={`${agent.agent_id}/${camera.device}`} agent={agent}
      camera={camera} stale={stale} onDone={onDone} />)}</ul>}</FirstOf>
  </Panel>;
}
