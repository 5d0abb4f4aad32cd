// SPDX-License-Identifier: Apache-2.0
// Large rigs: what is listed first, what a search finds, where the dots of the map are.
import assert from 'node:assert/strict';
import { test } from 'node:test';
import type { LiveAlert, LiveCamera } from '../src/api/types';
import { matching, needsOf, needsText } from '../src/cameras/camera_needs';
import { cameraAt, layoutMap } from '../src/cameras/map_layout';
import { modelOfEstimate } from '../src/view/rig_model';
import { groupAlerts } from '../src/wave/alerts';
import { MockRig } from './mock_rig';

const camera = (name: string, fields: Partial<LiveCamera> = {}): LiveCamera => ({ camera: name, agent_id: `pc-of-${name}`, state: 'STATE_CAPTURING', ...fields });
const alert = (name: string, severity: LiveAlert['severity'], kind = 'no_wand'): LiveAlert => ({ camera: name, severity, kind, text: `${name} ${kind}` });

test('cameras that need something come first: errors, warnings, notes, then the least seen', () => {
  const cameras = [camera('c10'), camera('c2'), camera('noted'), camera('lost', { dropped_count: '3' }), camera('warned'),
    camera('away', { state: 'STATE_OFFLINE' }), camera('blind'), camera('behind', { shared_instant_count: 10, shared_instant_goal: 400 })];
  const needs = needsOf(cameras, [alert('blind', 'SEVERITY_ERROR'), alert('warned', 'SEVERITY_WARNING'), alert('noted', 'SEVERITY_INFO')]);
  assert.deepEqual(needs.map((need) => need.name), ['away', 'blind', 'lost', 'warned', 'noted', 'behind', 'c2', 'c10']);
  assert.equal(needsText(needs), '4 good, 4 need something');
  assert.equal(needsText(needs.slice(1, 2)), '0 good, 1 needs something');
  assert.equal(needsText(needs.slice(5)), 'all 3 good');
  assert.equal(needs[0]!.why, 'Its agent is not connected.');
});

test('of several alerts of a camera the first, which is the worst, counts', () => {
  const needs = needsOf([camera('a')], [alert('a', 'SEVERITY_ERROR'), alert('a', 'SEVERITY_WARNING', 'clock_off')]);
  assert.deepEqual([needs[0]!.mark, needs[0]!.why], ['bad', 'a no_wand']);
});

test('a search finds every word in name, agent or need', () => {
  const needs = needsOf([camera('hall_1'), camera('hall_12'), camera('stage')], [alert('stage', 'SEVERITY_ERROR')]);
  const found = (text: string): string[] => matching(needs, text).map((need) => need.name);
  assert.deepEqual(found('hall_1'), ['hall_1', 'hall_12']);
  assert.deepEqual(found(' PC-OF 12 '), ['hall_12']);
  assert.deepEqual(found('no_wand'), ['stage']);
  assert.deepEqual(found('hall stage'), []);
  assert.equal(found('').length, 3);
});

test('few alerts stay alone, of many those of one kind are one', () => {
  const few = ['a', 'b'].map((name) => alert(name, 'SEVERITY_ERROR'));
  assert.equal(groupAlerts(few).length, 2);
  const many = [...Array.from({ length: 12 }, (_, i) => alert(`c${i}`, 'SEVERITY_ERROR')), alert('x', 'SEVERITY_WARNING'),
    { kind: 'disk_full', severity: 'SEVERITY_ERROR', text: 'The disk is full.' } as LiveAlert];
  assert.deepEqual(groupAlerts(many).map((group) => group.cameras.length), [12, 1, 1]);
});

/** 500 cameras, of which those without a pose are the last ones. */
function largeRig(posed: number): { names: string[]; cameras: ReturnType<typeof modelOfEstimate>['cameras'] } {
  const rig = new MockRig(500);
  rig.create({ id: 's' });
  rig.start();
  rig.advance(8);
  const parts = rig.parts();
  return { names: rig.cameras.map((one) => one.name), cameras: modelOfEstimate(parts.estimate, parts.cameras).cameras.slice(0, posed) };
}

test('every dot of the map is inside of it, and a tap finds it', () => {
  for (const posed of [0, 1, 250, 500]) {
    const { names, cameras } = largeRig(posed);
    for (const [width, height] of [[360, 330], [700, 430]] as const) {
      const layout = layoutMap(names, cameras, width, height);
      assert.equal(layout.at.size, 500);
      assert.equal(layout.unplaced, posed < 2 ? 0 : 500 - posed);
      assert.equal(layout.pixelsPerMetre === undefined, posed < 2);
      for (const [name, [x, y]] of layout.at) {
        assert.ok(x >= 8 && x <= width - 8 && y >= 20 && y <= height - 20, `${posed} posed, ${width}: ${name} at ${x} ${y}`);
        const [fx, fy] = layout.at.get(cameraAt(layout, [x, y], 22)!)!;
        assert.ok(Math.hypot(fx - x, fy - y) < 1e-6, name);
      }
      assert.equal(cameraAt(layout, [-100, -100], 22), undefined);
    }
  }
});

test('the map is seen from above: right is right, and forward is up', () => {
  const pose = (x: number, y: number) => ({ r: [[1, 0, 0], [0, 1, 0], [0, 0, 1]], t: [x, y, 9] });
  const cameras = [['left', -2, 0], ['right', 2, 0], ['front', 0, 3]].map(([name, x, y]) => ({ name, rigFromCam: pose(x as number, y as number), halfWidth: 0.5, halfHeight: 0.5 })) as unknown as Parameters<typeof layoutMap>[1];
  const { at, pixelsPerMetre } = layoutMap(['left', 'right', 'front'], cameras, 400, 300);
  assert.ok(at.get('left')![0] < at.get('right')![0]);
  assert.ok(at.get('front')![1] < at.get('left')![1]);
  assert.ok(Math.abs(at.get('right')![0] - at.get('left')![0] - 4 * pixelsPerMetre!) < 1e-6);
});
