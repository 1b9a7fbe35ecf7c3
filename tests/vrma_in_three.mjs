// Plays a VRM animation in three.js with three-vrm on an avatar of the humanoid's proportions whose bones have rest
// rotations of their own, compares the places of its bones with ours, and validates the file.
//   python tests/vrma_for_three.py FOLDER [MOTION]
//   npm install --prefix FOLDER three @pixiv/three-vrm @pixiv/three-vrm-animation gltf-validator
//   cp tests/vrma_in_three.mjs FOLDER && node FOLDER/vrma_in_three.mjs
import { readFileSync } from 'fs';
import validator from 'gltf-validator';
import * as THREE from 'three';

globalThis.self = globalThis;
const { GLTFLoader } = await import('three/examples/jsm/loaders/GLTFLoader.js');
const { VRMAnimationLoaderPlugin, createVRMAnimationClip } = await import('@pixiv/three-vrm-animation');
const { VRMHumanoid } = await import('@pixiv/three-vrm');

const folder = new URL('.', import.meta.url);
const { fps, joints, places } = JSON.parse(readFileSync(new URL('motion.json', folder)));
const content = new Uint8Array(readFileSync(new URL('motion.vrma', folder)));
const report = await validator.validateBytes(content);
console.log(`validator: ${report.issues.numErrors} errors, ${report.issues.numWarnings} warnings`);

let seed = 1;
const random = () => (seed = (seed * 16807) % 2147483647) / 2147483647 - 0.5;
const scene = new THREE.Group();
const nodes = {}, turns = {}, bones = {};
for (const { name, parent, offset } of joints) {
  const node = new THREE.Object3D();
  node.name = name; // tracks find bones by their nodes' names
  turns[name] = new THREE.Quaternion().setFromEuler(new THREE.Euler(4 * random(), 4 * random(), 4 * random()));
  const above = (parent ? turns[parent].clone() : new THREE.Quaternion()).invert();
  node.position.fromArray(offset).applyQuaternion(above);
  node.quaternion.copy(above.multiply(turns[name]));
  (parent ? nodes[parent] : scene).add(node);
  nodes[name] = node;
  if (!name.endsWith('_end')) bones[name] = { node };
}
scene.updateWorldMatrix(true, true);
const humanoid = new VRMHumanoid(bones);
scene.add(humanoid.normalizedHumanBonesRoot);

const loader = new GLTFLoader();
loader.register((parser) => new VRMAnimationLoaderPlugin(parser));
const gltf = await loader.parseAsync(content.buffer, '');
const clip = createVRMAnimationClip(gltf.userData.vrmAnimations[0], { humanoid, meta: { metaVersion: '1' }, scene });
const mixer = new THREE.AnimationMixer(scene);
mixer.clipAction(clip).play();
let worst = 0;
places.forEach((frame, t) => {
  mixer.setTime(Math.min(t / fps, clip.duration - 1e-5));
  humanoid.update();
  scene.updateWorldMatrix(true, true);
  joints.forEach(({ name }, j) => {
    const apart = nodes[name].getWorldPosition(new THREE.Vector3()).distanceTo(new THREE.Vector3(...frame[j]));
    worst = Math.max(worst, apart);
  });
});
console.log(`${places.length} frames, ${joints.length} joints, at most ${(1000 * worst).toFixed(3)} mm apart`);
