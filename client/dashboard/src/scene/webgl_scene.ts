// SPDX-License-Identifier: Apache-2.0
// The rig in 3-D. Loaded only when it is shown. Draws when something has changed, never otherwise.
import {
  AmbientLight, BufferAttribute, BufferGeometry, CanvasTexture, Color, DirectionalLight, DynamicDrawUsage, GridHelper,
  Group, IcosahedronGeometry, InstancedMesh, Line, LineBasicMaterial, LineSegments, Matrix4, Mesh, MeshBasicMaterial,
  MeshLambertMaterial, type Object3D, OctahedronGeometry, PerspectiveCamera, Scene, SphereGeometry, Sprite,
  SpriteMaterial, Vector3, WebGLRenderer,
} from 'three';
import { OrbitControls } from 'three/examples/jsm/controls/OrbitControls.js';
import { mostNamed } from './plan_layout';
import { palette } from '../shell/palette';
import { errorQuality, qualityRgb, wantedMm } from '../view/colour_scale';
import { add, boxOf, type DrawnCamera, scale, type Vec3 } from '../view/geometry';
import type { RigModel } from '../view/rig_model';

const maxPlaces = 4096;
/** Edge of a cell of the grid on the floor, metres. */
export const gridCellM = 0.5;
/** So many pictures are timed, and slower ones than this are of no use, ms. */
const timedPictures = 3;
const slowMs = 400;

// Room (x right, y forward, z up) to three.js (y up).
const place = ([x, y, z]: Vec3): Vector3 => new Vector3(x, z, -y);

function frustumPoints(camera: DrawnCamera, depth: number): Vec3[] {
  const { r, t } = camera.rigFromCam;
  const corner = (x: number, y: number): Vec3 => {
    const p: Vec3 = [x * camera.halfWidth * depth, y * camera.halfHeight * depth, depth];
    return add(t, [r[0][0] * p[0] + r[0][1] * p[1] + r[0][2] * p[2], r[1][0] * p[0] + r[1][1] * p[1] + r[1][2] * p[2],
      r[2][0] * p[0] + r[2][1] * p[1] + r[2][2] * p[2]]);
  };
  const [a, b, c, d] = [corner(-1, -1), corner(1, -1), corner(1, 1), corner(-1, 1)];
  const top: Vec3 = corner(0, -1.45);
  return [t, a, t, b, t, c, t, d, a, b, b, c, c, d, d, a, a, top, top, b];
}

function lineGeometry(points: readonly Vec3[]): BufferGeometry {
  const array = new Float32Array(points.length * 3);
  points.forEach((point, i) => place(point).toArray(array, i * 3));
  return new BufferGeometry().setAttribute('position', new BufferAttribute(array, 3));
}

/** What is drawn on a canvas with WebGL. The constructor throws where there is none. */
export class WebGlScene {
  private readonly renderer: WebGLRenderer;
  private readonly scene = new Scene();
  private readonly eye = new PerspectiveCamera(45, 1, 0.01, 500);
  private readonly controls: OrbitControls;
  private readonly places: InstancedMesh;
  private cameraGroup = new Group();
  private readonly marks = new Group();
  private readonly grid: GridHelper;
  private readonly wandLine: Line;
  private readonly wandBalls: Mesh[] = [];
  private readonly worst: Mesh;
  private readonly tips: Mesh[] = [];
  private model: RigModel | undefined;
  private cameraKey = '';
  private placesOf: unknown;
  private wanted = 0;
  private framed = '';
  private touched = false;
  private readonly labels: Sprite[] = [];
  private labelHeight = 0.04;
  private asked = 0;
  private readonly axes = new Group();
  private readonly times: number[] = [];
  private timed = false;

  /** `onSlow` is called where a picture takes too long, with its milliseconds. */
  constructor(canvas: HTMLCanvasElement, private readonly onSlow: ((ms: number) => void) | undefined) {
    this.renderer = new WebGLRenderer({ canvas, antialias: true, alpha: true, powerPreference: 'low-power' });
    this.renderer.setPixelRatio(Math.min(2, window.devicePixelRatio || 1));
    const colours = palette();
    this.controls = new OrbitControls(this.eye, canvas);
    this.controls.enableDamping = false;
    this.controls.listenToKeyEvents(canvas);
    this.controls.addEventListener('change', this.draw);
    this.controls.addEventListener('start', () => { this.touched = true; });
    this.scene.add(new AmbientLight(0xffffff, 1.6));
    const sun = new DirectionalLight(0xffffff, 1.8);
    sun.position.set(1, 3, 2);
    this.scene.add(sun, this.cameraGroup, this.marks, this.axes);
    this.grid = new GridHelper(10, 10 / gridCellM, new Color(colours.faint), new Color(colours.line));
    this.grid.visible = false;
    this.scene.add(this.grid);
    this.places = new InstancedMesh(new OctahedronGeometry(1),
      new MeshLambertMaterial({ transparent: true, opacity: 0.8 }), maxPlaces);
    this.places.instanceMatrix.setUsage(DynamicDrawUsage);
    this.places.setColorAt(0, new Color(1, 1, 1));
    this.places.count = 0;
    this.places.frustumCulled = false;
    this.scene.add(this.places);
    const white = new MeshBasicMaterial({ color: new Color(colours.ink), depthTest: false, transparent: true });
    this.wandLine = new Line(new BufferGeometry().setAttribute('position', new BufferAttribute(new Float32Array(48), 3)),
      new LineBasicMaterial({ color: new Color(colours.ink), depthTest: false, transparent: true }));
    this.wandLine.frustumCulled = false;
    this.wandLine.renderOrder = 2;
    this.marks.add(this.wandLine);
    const ball = new SphereGeometry(0.045, 16, 12);
    for (let i = 0; i < 16; ++i) this.wandBalls.push(new Mesh(ball, white));
    for (const one of this.wandBalls) one.renderOrder = 2;
    this.worst = new Mesh(new IcosahedronGeometry(0.11), new MeshBasicMaterial({ color: new Color(colours.ink), wireframe: true }));
    for (let i = 0; i < 3; ++i) {
      this.tips.push(new Mesh(new IcosahedronGeometry(i === 0 ? 0.2 : 0.13, 1),
        new MeshBasicMaterial({ color: new Color(colours.accent), wireframe: true, transparent: true, opacity: i === 0 ? 0.9 : 0.45 })));
    }
    this.marks.add(this.worst, ...this.wandBalls, ...this.tips);
    for (const mark of [this.worst, ...this.wandBalls, ...this.tips]) mark.visible = false;
  }

  resize(width: number, height: number): void {
    if (width < 2 || height < 2) return;
    this.renderer.setSize(width, height, false);
    this.eye.aspect = width / height;
    this.eye.updateProjectionMatrix();
    // Names are as high as the text of the page, however far away.
    const textPx = Math.max(15, parseFloat(getComputedStyle(document.documentElement).fontSize) || 0);
    this.labelHeight = ((1.35 * textPx) / height) * 2 * Math.tan((this.eye.fov * Math.PI) / 360);
    this.labels.forEach((label) => this.sizeLabel(label));
    if (!this.touched) this.framed = '';
    if (this.model) this.frame(this.model);
    this.draw();
  }

  private sizeLabel(label: Sprite): void {
    label.scale.set(this.labelHeight * (label.userData['shape'] as number), this.labelHeight, 1);
  }

  /** Shows a model. What did not change is not made anew. */
  show(model: RigModel, goalMm: number | undefined): void {
    this.model = model;
    const key = JSON.stringify([model.cameras, [...model.ellipsoids], model.frame]);
    if (key !== this.cameraKey) this.showCameras(model, key);
    const wanted = wantedMm(goalMm);
    if (model.places !== this.placesOf || wanted !== this.wanted) this.showPlaces(model, wanted);
    const line = this.wandLine.geometry.getAttribute('position') as BufferAttribute;
    const wand = model.wand.slice(0, 16);
    wand.forEach((point, i) => place(point).toArray(line.array as Float32Array, i * 3));
    line.needsUpdate = true;
    this.wandLine.geometry.setDrawRange(0, wand.length);
    this.wandBalls.forEach((ball, i) => this.put(ball, wand[i]));
    this.put(this.worst, model.worst);
    this.tips.forEach((tip, i) => this.put(tip, model.advice[i]));
    this.frame(model);
    this.draw();
  }

  private put(mark: Object3D, point: Vec3 | undefined): void {
    mark.visible = point !== undefined;
    if (point) mark.position.copy(place(point));
  }

  private showPlaces(model: RigModel, wanted: number): void {
    this.placesOf = model.places;
    this.wanted = wanted;
    const matrix = new Matrix4();
    const colour = new Color();
    const shown = model.places.slice(0, maxPlaces);
    const step = model.stepM > 0 ? model.stepM : 0.1;
    shown.forEach((one, i) => {
      const quality = errorQuality(one.sigmaMm, wanted);
      // The worse, the larger: size tells what colour tells.
      const size = step * (0.1 + 0.26 * (1 - quality)) * (one.waved ? 1 : 0.75);
      matrix.makeScale(size, size, size).setPosition(place(one.at));
      this.places.setMatrixAt(i, matrix);
      const [r, g, b] = qualityRgb(quality);
      this.places.setColorAt(i, colour.setRGB(r / 255, g / 255, b / 255, 'srgb'));
    });
    this.places.count = shown.length;
    this.places.instanceMatrix.needsUpdate = true;
    if (this.places.instanceColor) this.places.instanceColor.needsUpdate = true;
  }

  private showCameras(model: RigModel, key: string): void {
    this.cameraKey = key;
    this.scene.remove(this.cameraGroup);
    free(this.cameraGroup);
    this.cameraGroup = new Group();
    this.labels.length = 0;
    const colours = palette();
    const box = boxOf(model.cameras.map((camera) => camera.rigFromCam.t));
    const size = box ? Math.max(0.5, ...box.max.map((v, k) => v - box.min[k]!)) : 1;
    const worstSigma = Math.max(0, ...[...model.ellipsoids.values()].flat().map((axis) => Math.hypot(...axis)));
    for (const camera of model.cameras) {
      this.cameraGroup.add(new LineSegments(lineGeometry(frustumPoints(camera, size * 0.07)),
        new LineBasicMaterial({ color: new Color(colours.ink) })));
      if (model.cameras.length <= mostNamed) {
        const label = textSprite(camera.name, colours.ink);
        this.sizeLabel(label);
        this.labels.push(label);
        label.position.copy(place(camera.rigFromCam.t)).add(new Vector3(0, size * 0.05, 0));
        this.cameraGroup.add(label);
      }
      const axes = model.ellipsoids.get(camera.name);
      if (!axes || worstSigma <= 0) continue;
      const ball = new Mesh(new SphereGeometry(1, 20, 12),
        new MeshLambertMaterial({ color: new Color(colours.accent), transparent: true, opacity: 0.45 }));
      const grow = (size * 0.08) / worstSigma;
      const [x, y, z] = axes.map((axis) => place(scale(axis, grow)));
      const smallest = size * 0.004;
      for (const axis of [x!, y!, z!]) if (axis.length() < smallest) axis.setLength(smallest);
      ball.matrixAutoUpdate = false;
      ball.matrix.makeBasis(x!, y!, z!).setPosition(place(camera.rigFromCam.t));
      this.cameraGroup.add(ball);
    }
    this.scene.add(this.cameraGroup);
    this.showAxes(model, size * 0.12, colours.ink);
  }

  /** The axes of the rig frame. */
  private showAxes(model: RigModel, long: number, ink: string): void {
    free(this.axes);
    this.axes.clear();
    const { origin, axes } = model.frame;
    this.axes.add(new LineSegments(lineGeometry(axes.flatMap((axis) => [origin, add(origin, scale(axis, long))])),
      new LineBasicMaterial({ color: new Color(ink) })));
    for (const [k, name] of (['x', 'y', 'z'] as const).entries()) {
      const label = textSprite(name, ink);
      this.sizeLabel(label);
      this.labels.push(label);
      label.position.copy(place(add(origin, scale(axes[k]!, long * 1.12))));
      this.axes.add(label);
    }
  }

  /** Looks at everything, until the person has turned the view. */
  private frame(model: RigModel): void {
    const box = boxOf([...model.cameras.map((camera) => camera.rigFromCam.t), ...model.places.map((one) => one.at)]);
    if (!box) return;
    const size = Math.max(1, ...box.max.map((v, k) => v - box.min[k]!));
    const centre = place(scale(add(box.min, box.max), 0.5));
    this.grid.visible = true;
    this.grid.position.set(Math.round(centre.x), model.frameIsSet ? 0 : Math.min(box.min[2], 0), Math.round(centre.z));
    const grows = `${Math.round(Math.log2(size) * 2)} ${model.cameras.length}`;
    if (this.touched || grows === this.framed) return;
    this.framed = grows;
    this.controls.target.copy(centre);
    this.eye.position.copy(centre).add(new Vector3(0.28, 0.62, 0.95).multiplyScalar(size * Math.max(1.02, 1.6 / this.eye.aspect)));
    this.controls.update();
  }

  /** Looks at everything again. */
  reset(model: RigModel): void {
    this.touched = false;
    this.framed = '';
    this.frame(model);
    this.draw();
  }

  readonly draw = (): void => {
    if (this.asked) return;
    this.asked = requestAnimationFrame(() => {
      this.asked = 0;
      const began = performance.now();
      this.renderer.render(this.scene, this.eye);
      if (this.onSlow && this.model && !this.timed) this.time(began, this.onSlow);
    });
  };

  /** How long a picture takes is known once a pixel of it has been read. */
  private time(began: number, onSlow: (ms: number) => void): void {
    const gl = this.renderer.getContext();
    gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
    this.times.push(performance.now() - began);
    // The first one makes the shaders.
    const [, ...later] = this.times;
    this.timed = later.length + 1 >= timedPictures || later.some((ms) => ms < slowMs / 4);
    if (!this.timed) {
      this.draw();
      return;
    }
    const fastest = Math.min(...later);
    if (fastest > slowMs) onSlow(fastest);
  }

  dispose(): void {
    cancelAnimationFrame(this.asked);
    this.controls.dispose();
    free(this.scene);
    this.places.dispose();
    this.renderer.dispose();
    this.renderer.forceContextLoss();
  }
}

function free(root: Object3D): void {
  root.traverse((object) => {
    const part = object as Partial<Mesh>;
    part.geometry?.dispose();
    for (const material of part.material ? [part.material].flat() : []) {
      (material as SpriteMaterial).map?.dispose();
      material.dispose();
    }
  });
}

function textSprite(text: string, colour: string): Sprite {
  const canvas = document.createElement('canvas');
  const context = canvas.getContext('2d')!;
  const font = '600 30px system-ui, sans-serif';
  context.font = font;
  canvas.width = Math.ceil(context.measureText(text).width) + 16;
  canvas.height = 40;
  context.font = font;
  context.textBaseline = 'middle';
  context.lineWidth = 6;
  context.lineJoin = 'round';
  context.strokeStyle = palette().surface;
  context.strokeText(text, 8, 20);
  context.fillStyle = colour;
  context.fillText(text, 8, 20);
  const texture = new CanvasTexture(canvas);
  const sprite = new Sprite(new SpriteMaterial({ map: texture, depthTest: false, transparent: true, sizeAttenuation: false }));
  sprite.userData['shape'] = canvas.width / canvas.height;
  sprite.center.set(0.5, 0);
  return sprite;
}
