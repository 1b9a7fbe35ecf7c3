import js from "@eslint/js";
import { defineConfig } from "eslint/config";
import typescript from "typescript-eslint";

export default defineConfig(
  js.configs.recommended,
  typescript.configs.recommended,
  {
    files: ["src/**"],
    // a variable is named for what it holds
    rules: {
      "id-denylist": ["error", "found", "one", "own", "told", "said", "given", "asked", "how", "those"],
    },
  },
  {
    files: ["tests/**"],
    // files are broken on purpose
    rules: { "@typescript-eslint/no-explicit-any": "off" },
  },
);
