/* The tables of joints' names, which are those of the Python package: a file for each convention. */
import accad from "../../../../motet/figures/humanoid/conventions/accad.json";
import bandaiNamco from "../../../../motet/figures/humanoid/conventions/bandai-namco.json";
import biped from "../../../../motet/figures/humanoid/conventions/biped.json";
import blenderMetarig from "../../../../motet/figures/humanoid/conventions/blender-metarig.json";
import characterCreator from "../../../../motet/figures/humanoid/conventions/character-creator.json";
import cmuAmc from "../../../../motet/figures/humanoid/conventions/cmu-amc.json";
import cmuBvh43 from "../../../../motet/figures/humanoid/conventions/cmu-bvh-43.json";
import cmuBvh from "../../../../motet/figures/humanoid/conventions/cmu-bvh.json";
import daz from "../../../../motet/figures/humanoid/conventions/daz.json";
import kaykit from "../../../../motet/figures/humanoid/conventions/kaykit.json";
import lafan1 from "../../../../motet/figures/humanoid/conventions/lafan1.json";
import makehuman from "../../../../motet/figures/humanoid/conventions/makehuman.json";
import mixamo from "../../../../motet/figures/humanoid/conventions/mixamo.json";
import mmd from "../../../../motet/figures/humanoid/conventions/mmd.json";
import mmm from "../../../../motet/figures/humanoid/conventions/mmm.json";
import perceptionNeuron from "../../../../motet/figures/humanoid/conventions/perception-neuron.json";
import poser from "../../../../motet/figures/humanoid/conventions/poser.json";
import rigify from "../../../../motet/figures/humanoid/conventions/rigify.json";
import rokoko from "../../../../motet/figures/humanoid/conventions/rokoko.json";
import sfu from "../../../../motet/figures/humanoid/conventions/sfu.json";
import smpl from "../../../../motet/figures/humanoid/conventions/smpl.json";
import soma from "../../../../motet/figures/humanoid/conventions/soma.json";
import unity from "../../../../motet/figures/humanoid/conventions/unity.json";
import unreal from "../../../../motet/figures/humanoid/conventions/unreal.json";
import vrchat from "../../../../motet/figures/humanoid/conventions/vrchat.json";
import vrmAddOn from "../../../../motet/figures/humanoid/conventions/vrm-add-on.json";
import vroid from "../../../../motet/figures/humanoid/conventions/vroid.json";
import xsensBvh from "../../../../motet/figures/humanoid/conventions/xsens-bvh.json";
import xsens from "../../../../motet/figures/humanoid/conventions/xsens.json";
import type { Vector } from "../../motion/rotations.js";

/** docs/reference/retargeting.md, "The tables of names". */
export interface Table {
  title: string;
  prefixes?: string[];
  sides: [string, string][];
  joints: Record<string, string[]>;
  aside?: string[];
  marks?: string[];
  optional?: string[];
  rest?: Record<string, Vector>;
  points?: Record<string, Vector>;
  axes?: Record<string, string>;
}

/** In the order of their files' names. */
export const TABLES = [
  accad,
  bandaiNamco,
  biped,
  blenderMetarig,
  characterCreator,
  cmuAmc,
  cmuBvh43,
  cmuBvh,
  daz,
  kaykit,
  lafan1,
  makehuman,
  mixamo,
  mmd,
  mmm,
  perceptionNeuron,
  poser,
  rigify,
  rokoko,
  sfu,
  smpl,
  soma,
  unity,
  unreal,
  vrchat,
  vrmAddOn,
  vroid,
  xsensBvh,
  xsens,
] as Table[];
