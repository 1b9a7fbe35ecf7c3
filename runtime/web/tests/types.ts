/* The README's lines for three.js, as its users compile them: against three's and three-vrm's own types. Only checked. */
import type { VRM } from "@pixiv/three-vrm";
import * as THREE from "three";
import { fromHumanoid, GenerateModel, load, motionOf, readGLB, toThree } from "../src/index.js";

export async function play(vrm: VRM, bytes: Uint8Array): Promise<THREE.AnimationAction[]> {
  const mixer = new THREE.AnimationMixer(vrm.scene);
  const generator = await load("/bundles/generate.zip", GenerateModel);
  const [{ frames: drawn }] = await generator.generate("a person waves", { seed: 1, seconds: 3 });
  const motion = motionOf(drawn, generator.manifest);
  const waves = THREE.AnimationClip.parse(toThree(motion, vrm));
  const ofNodes = THREE.AnimationClip.parse(toThree(fromHumanoid(motion, readGLB(bytes), { ahead: true })));
  return [mixer.clipAction(waves).play(), mixer.clipAction(ofNodes).play()];
}
