// SPDX-License-Identifier: Apache-2.0
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { compareCalibrations } from '../src/result/compare';
import { compose, cross, dot, drawnCamera, inverse, length, poseOf, type Pose, roomFromRig, rotationAngle, rotationOf,
  subtract, times, transposed, type Vec3 } from '../src/view/geometry';
import { modelOfCalibration, modelOfEstimate } from '../src/view/rig_model';
import { flattened } from '../src/scene/draw_plan';
import { mockAccuracy, mockCalibration } from './mock_calibration';
import { MockRig, quaternionOf } from './mock_rig';

const near = (a: number, b: number, tolerance = 1e-12): void => assert.ok(Math.abs(a - b) <= tolerance, `${a} is not ${b}`);

test('a quarter turn about z takes x to y', () => {
  const r = rotationOf({ w: Math.SQRT1_2, z: Math.SQRT1_2 })!;
  const turned = times(r, [1, 0, 0]);
  near(turned[0], 0);
  near(turned[1], 1);
  near(rotationAngle(r), Math.PI / 2);
});

test('an unset or zero rotation is not taken for the identity', () => {
  assert.equal(rotationOf(undefined), undefined);
  assert.equal(rotationOf({}), undefined);
  assert.equal(poseOf({ translation_m: { x: 1 } }), undefined);
  assert.equal(drawnCamera('a', undefined, 640, 480, 500), undefined);
});

test('a pose and its inverse cancel', () => {
  const pose: Pose = poseOf({ rotation: { w: 0.5, x: -0.5, y: 0.5, z: 0.5 }, translation_m: { x: 1, y: 2, z: 3 } })!;
  const none = compose(pose, inverse(pose));
  near(rotationAngle(none.r), 0, 1e-7);
  near(length(none.t), 0);
});

test('small angles keep their digits', () => {
  near(rotationAngle(rotationOf({ w: 1, x: 0.5e-7 })!), 1e-7, 1e-13);
});

test('the room is right-handed, its up is against the cameras\' y, for any camera', () => {
  const rig = new MockRig(8);
  for (const first of [rig.cameras, rig.cameras.slice(3), []]) {
    const drawn = first.map((camera) => drawnCamera(camera.name, { rotation: quaternionOf(camera.camFromRig), translation_m: {} }, 1440, 1080, 1100)!);
    const [right, forward, up] = roomFromRig(drawn);
    near(dot(right, forward), 0);
    near(length(subtract(cross(right, forward), up)), 0);
    if (first.length > 2) assert.ok(up[1] < -0.95);
  }
  const down = drawnCamera('down', { rotation: { w: Math.SQRT1_2, x: Math.SQRT1_2 } }, 10, 10, 10)!;
  assert.ok(roomFromRig([down]).flat().every(Number.isFinite));
});

test('the model puts cameras where the rig has them', () => {
  const rig = new MockRig(6);
  rig.create({ id: 's' });
  rig.start();
  rig.advance(30);
  const { estimate, cameras } = rig.parts();
  const model = modelOfEstimate(estimate, cameras);
  assert.equal(model.cameras.length, 6);
  const at = (i: number): Vec3 => model.cameras[i]!.rigFromCam.t;
  for (let i = 1; i < 6; ++i) {
    near(length(subtract(at(0), at(i))), length(subtract(rig.cameras[0]!.centre, rig.cameras[i]!.centre)), 1e-6);
  }
  // Viewing directions meet in the middle of the ring.
  const middle = model.cameras.reduce<Vec3>((sum, camera) => [sum[0] + camera.rigFromCam.t[0] / 6, sum[1] + camera.rigFromCam.t[1] / 6, sum[2]], [0, 0, 0]);
  for (const { rigFromCam: { r, t } } of model.cameras) {
    const axis: Vec3 = [r[0][2], r[1][2], r[2][2]];
    assert.ok(dot(axis, subtract([middle[0], middle[1], t[2]], t)) > 2);
    near(rotationAngle(compose({ r, t }, { r: transposed(r), t: [0, 0, 0] }).r), 0, 1e-7);
  }
  assert.ok(model.places.length > 50);
  assert.ok(model.places.every((place) => place.sigmaMm > 0));
  assert.ok(model.places.some((place) => !place.waved));
  assert.ok(model.advice.length > 0 && model.wand.length > 0);
  const done = modelOfEstimate(estimate, cameras, false);
  assert.deepEqual([done.advice, done.wand], [[], []], 'nobody is told where to wave when nobody waves');
});

test('an empty or damaged volume draws nothing', () => {
  assert.equal(modelOfEstimate(undefined, []).places.length, 0);
  assert.equal(modelOfEstimate({ volume: { sigma_mm: [1, 2, 3] } }, []).places.length, 0);
  assert.equal(modelOfEstimate({ volume: { count_x: 1, count_y: 1, count_z: 1, sigma_mm: [NaN as unknown as number] } }, []).places.length, 0);
});

test('the plan keeps the worst of each column', () => {
  const model = modelOfCalibration({}, { grid_step_m: 1, grid: [{ point_m: { z: 1 }, calibration_total_m: 1e-3 },
    { point_m: { z: 1, y: 3 }, calibration_total_m: 4e-3 }, { point_m: { z: 2 }, calibration_total_m: 2e-3 }] });
  assert.deepEqual(flattened(model, 'top').map((one) => one.sigmaMm).sort(), [2, 4]);
});

test('a rig that was turned as a whole shows no difference; a moved camera does', () => {
  const rig = new MockRig(5);
  const one = mockCalibration(rig, 'c-1', 1, ['s'], 1);
  const turn = poseOf({ rotation: { w: Math.cos(0.3), y: Math.sin(0.3) }, translation_m: { x: 1, y: -2, z: 0.5 } })!;
  const moved = structuredClone(one);
  for (const camera of moved.cameras!) {
    const pose = compose(poseOf(camera.cam_from_rig)!, turn);
    camera.cam_from_rig = { rotation: quaternionOf(pose.r), translation_m: { x: pose.t[0], y: pose.t[1], z: pose.t[2] } };
  }
  for (const difference of compareCalibrations(one, moved).cameras) {
    assert.ok(difference.positionMm! < 1e-3, `${difference.camera} ${difference.positionMm}`);
    assert.ok(difference.rotationDeg! < 1e-3);
  }
  moved.cameras![2]!.cam_from_rig!.translation_m!.x! += 0.005;
  const found = compareCalibrations(one, moved).cameras;
  near(found[2]!.positionMm!, 5, 1e-3);
  assert.ok(found[2]!.positionSigmas! > 3);
  near(found[1]!.positionMm!, 0, 1e-3);
});

test('cameras that only one calibration has are named without figures', () => {
  const rig = new MockRig(3);
  const one = mockCalibration(rig, 'c-1', 1, ['s'], 1);
  const other = structuredClone(one);
  other.cameras!.pop();
  const last = compareCalibrations(one, other).cameras.at(-1)!;
  assert.equal(last.positionMm, undefined);
  assert.deepEqual(compareCalibrations(one, {}).reference, '');
  assert.equal(compareCalibrations({ ...one, scale_known: false }, other).cameras[1]!.positionMm, undefined);
  assert.ok(modelOfCalibration(one, mockAccuracy('c-1')).ellipsoids.size === 3);
});
