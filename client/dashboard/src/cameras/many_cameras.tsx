// SPDX-License-Identifier: Apache-2.0
import type { JSX } from 'preact';
import { useMemo, useState } from 'preact/hooks';
import type { LiveAlert } from '../api/types';
import type { RigState } from '../live/live_merge';
import type { RigModel } from '../view/rig_model';
import { CameraTile } from '../wave/camera_tile';
import { CameraList, SearchField } from './camera_list';
import { CameraMap } from './camera_map';
import { matching, needsOf, needsText } from './camera_needs';

/** The cameras of a rig that is too large for a tile each: how many are good, a map, a list to search, and the tile of the one that was chosen. */
export function ManyCameras({ rig, model, stale, theme, pictures, alertOf }: {
  rig: RigState; model: RigModel; stale: boolean; theme: string; pictures: boolean;
  alertOf: ReadonlyMap<string, LiveAlert>;
}): JSX.Element {
  const [text, setText] = useState('');
  const [chosen, setChosen] = useState('');
  const needs = useMemo(() => needsOf(rig.cameras, rig.alerts), [rig.cameras, rig.alerts]);
  const shown = useMemo(() => matching(needs, text), [needs, text]);
  const found = useMemo(() => new Set(shown.map((need) => need.name)), [shown]);
  const one = needs.find((need) => need.name === chosen);
  return <div class="many">
    <p class="summary" role="status">{stale ? 'Not known while the server does not answer' : needsText(needs)}</p>
    <CameraMap needs={needs} found={found} model={model} chosen={chosen} theme={theme} onChoose={setChosen} />
    <div class="manylist">
      {one && <ul class="chosen"><CameraTile camera={one.camera} alert={alertOf.get(one.name)} stale={stale} theme={theme}
        pictures={pictures ? rig.rig : ''} state={rig.session?.id ?? ''} /></ul>}
      <SearchField text={text} label="Find a camera" onChange={setText} />
      <CameraList needs={shown} chosen={chosen} stale={stale} onChoose={setChosen} />
    </div>
  </div>;
}
