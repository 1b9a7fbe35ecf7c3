"""How ONNX Runtime runs a model: threads and execution providers."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import onnxruntime

from motet.errors import SettingError
from motet.settings import checked_int

MAX_THREADS = 256

Options = Mapping[str, str]


@dataclass(frozen=True)
class SessionOptions:
    """Options of every session of a model; the default is one thread of the CPU.

    threads: of one call of a graph, 1 to 256. 1 is right for step graphs: no idle spinning, and many sessions side by
        side; more pay in large batches.
    providers: execution providers of ONNX Runtime, the preferred first. ONNX Runtime gives the CPU what the others
        cannot run, all of it where one does not start: a model's ``providers`` are those that are really active.
    provider_options: options of each provider, in the same order; none by default.
    configure: called with the ``onnxruntime.SessionOptions`` of each session before it is made, for all else: the level
        of optimisation, profiling, spinning threads. A function of a module, if models are to be pickled.
    SettingError for a number of threads out of range, and for a provider that this build of ONNX Runtime does not have.
    """

    threads: int = 1
    providers: tuple[str, ...] = ("CPUExecutionProvider",)
    provider_options: tuple[Options, ...] = ()
    configure: Callable[[Any], None] | None = None

    def __post_init__(self) -> None:
        checked_int("threads", self.threads, 1, MAX_THREADS)
        if isinstance(self.providers, str):
            raise SettingError(f"providers must be a tuple of names, such as ({self.providers!r},)")
        available = onnxruntime.get_available_providers()
        for provider in self.providers:
            if provider not in available:
                raise SettingError(f"ONNX Runtime has no provider {provider!r} here; available: {', '.join(available)}")
        if not self.providers or len(self.provider_options) not in {0, len(self.providers)}:
            raise SettingError("give at least one provider, and options for each provider or for none")

    def session(self, model: bytes) -> Any:
        """A session of ONNX Runtime for a model in memory; raises what ONNX Runtime raises."""
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = int(self.threads)
        options.inter_op_num_threads = 1
        options.enable_cpu_mem_arena = False  # memory goes back after a large batch, at the same speed
        options.log_severity_level = 4
        if self.configure is not None:
            self.configure(options)
        options.add_session_config_entry("session.load_model_format", "ONNX")  # the one that was checked
        given = [dict(one) for one in self.provider_options] or None
        return onnxruntime.InferenceSession(model, options, list(self.providers), given, enable_fallback=0)
