import js from "@eslint/js";
import { defineConfig } from "eslint/config";
import typescript from "typescript-eslint";

export default defineConfig(js.configs.recommended, typescript.configs.recommended, {
  files: ["tests/**"],
  // files are broken on purpose
  rules: { "@typescript-eslint/no-explicit-any": "off" },
});
