// Validates a .glb with the Khronos validator, and plays it with three.js in headless Chromium.
//
//     npm install
//     CHROMIUM=$(which chromium) node play.mjs FILE.glb FOLDER TIME…
//
// Writes a picture for each time into FOLDER, and prints as JSON what the validator says, and where each node stands at
// each time in the world of the file (matrices by columns). Nothing is fetched from anywhere: all that the page asks for comes
// from this folder's node_modules.

import { mkdtempSync, readFileSync, rmSync } from "node:fs";
import { createRequire } from "node:module";
import { tmpdir } from "node:os";
import { basename, dirname, join } from "node:path";
import { chromium } from "playwright-core";
import validator from "gltf-validator";

const [file, folder, ...times] = process.argv.slice(2);
const require = createRequire(import.meta.url);
const three = dirname(dirname(require.resolve("three")));
const bytes = readFileSync(file);

const PAGE = `<!doctype html><meta charset="utf-8"><style>body { margin: 0 }</style>
<script type="importmap">{"imports": {"three": "/three/build/three.module.js", "three/addons/": "/three/examples/jsm/"}}</script>
<script type="module">
import * as THREE from "three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";

const renderer = new THREE.WebGLRenderer({ antialias: true, preserveDrawingBuffer: true });
renderer.setSize(innerWidth, innerHeight);
document.body.append(renderer.domElement);
const scene = new THREE.Scene();
scene.background = new THREE.Color(0xf4f4f2);
scene.add(new THREE.HemisphereLight(0xffffff, 0x8d8d8d, 2.5));
const sun = new THREE.DirectionalLight(0xffffff, 2.0);
sun.position.set(2, 5, 3);
scene.add(sun);

const gltf = await new GLTFLoader().loadAsync("/file.glb");
scene.add(gltf.scene);
const mixer = new THREE.AnimationMixer(gltf.scene);
const actions = gltf.animations.map((clip) => mixer.clipAction(clip).setLoop(THREE.LoopOnce));
const camera = new THREE.PerspectiveCamera(35, innerWidth / innerHeight, 0.01, 100);

function at(time) {
  for (const action of actions) { // one that has ended is paused
    action.clampWhenFinished = true;
    action.reset().play();
  }
  mixer.setTime(time);
  scene.updateMatrixWorld(true);
}

window.look = (times) => { // at all that is seen at any of these times
  const box = new THREE.Box3();
  for (const time of times) { at(time); box.union(new THREE.Box3().setFromObject(gltf.scene, true)); }
  const ball = box.getBoundingSphere(new THREE.Sphere());
  const far = Math.max(ball.radius, 0.05) / Math.sin(THREE.MathUtils.degToRad(17.5));
  camera.position.copy(ball.center).add(new THREE.Vector3(0.8, 0.35, 0.6).normalize().multiplyScalar(far));
  camera.lookAt(ball.center);
  scene.add(new THREE.GridHelper(4 * ball.radius, 20, 0xaaaaaa, 0xd0d0d0));
};
window.show = (time) => {
  at(time);
  renderer.render(scene, camera);
  const nodes = {};
  gltf.scene.traverse((node) => { if (node.userData.name) nodes[node.userData.name] = node.matrixWorld.elements; });
  return { time, nodes };
};
window.about = () => ({
  clips: gltf.animations.map((clip) => ({ name: clip.name, duration: clip.duration, tracks: clip.tracks.length })),
  triangles: renderer.info.render.triangles,
});
window.ready = true;
</script>`;

const TYPES = { ".js": "text/javascript", ".glb": "model/gltf-binary" };

async function answer(route) {
  const { pathname } = new URL(route.request().url());
  if (pathname === "/") return route.fulfill({ contentType: "text/html", body: PAGE });
  if (pathname === "/file.glb") return route.fulfill({ contentType: TYPES[".glb"], body: bytes });
  if (pathname.startsWith("/three/") && !pathname.includes("..")) {
    return route.fulfill({ contentType: TYPES[".js"], body: readFileSync(join(three, pathname.slice("/three/".length))) });
  }
  return route.fulfill({ status: 404, body: "" });
}

const { issues, info } = await validator.validateBytes(new Uint8Array(bytes), { maxIssues: 1000 });

const profile = mkdtempSync(join(tmpdir(), "play-"));
const complaints = [];
let context;
try {
  context = await chromium.launchPersistentContext(profile, {
    executablePath: process.env.CHROMIUM,
    headless: true,
    viewport: { width: 640, height: 480 },
    args: [
      "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-quic", "--no-first-run",
      "--disable-background-networking", "--disable-component-update", "--disable-sync",
    ],
  });
  const page = await context.newPage();
  page.on("pageerror", (error) => complaints.push(String(error)));
  page.on("console", (message) => { if (message.type() === "error") complaints.push(message.text()); });
  await page.route("**/*", answer);
  await page.goto("http://play.invalid/");
  await page.waitForFunction("window.ready", null, { timeout: 60000 });
  await page.evaluate((all) => window.look(all), times.map(Number));
  const frames = [];
  for (const [k, time] of times.entries()) {
    frames.push(await page.evaluate((t) => window.show(t), Number(time)));
    await page.screenshot({ path: join(folder, `${basename(file, ".glb")}_${k}.png`) });
  }
  const about = await page.evaluate(() => window.about());
  console.log(JSON.stringify({ issues, info, complaints, ...about, frames }));
} catch (error) {
  console.error(String(error), complaints.join("\n"));
  process.exitCode = 1;
} finally {
  await context?.close();
  rmSync(profile, { recursive: true, force: true });
}
