"""Kernels that other kernels call, compiled as far as their callers need.

This takes hold of parts of numba that it does not promise to keep: `geometry.compiler` uses it with releases that it
was tried with.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Any, cast

from llvmlite import binding
from numba._dynfunc import make_function
from numba.core import types
from numba.core.caching import CompileResultCacheImpl
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.environment import Environment, lookup_environment
from numba.core.registry import CPUDispatcher


class LinkingDispatcher(CPUDispatcher):
    """What Python calls. Kernels that call it see another: its part inside them, which is not compiled for itself.

    numba compiles a callee whole, with a wrapper that unpacks Python's arguments, and then once more in each caller.
    Two kernels of three are only ever called by others, and more than a third of the time went there.
    """

    def __init__(self, py_func: Callable[..., object], names: dict[str, Any], targetoptions: dict[str, Any]) -> None:
        begin: Any = super().__init__  # of numba's signature, by which it also unpickles
        begin(py_func, names, targetoptions, _OutsideCompiler)

    @cached_property
    def _inside(self) -> Any:
        dispatcher, options = cast("Any", _InsideDispatcher), self.targetoptions | {"no_cpython_wrapper": True}
        return dispatcher(self.py_func, self.locals, options, _InsideCompiler)

    @property
    def _numba_type_(self) -> Any:
        """What callers compile and link."""
        return types.Dispatcher(self._inside)


class _InsideDispatcher(CPUDispatcher):
    """A kernel within others: compiled for an integer once, where numba compiles it for every number that is written
    in a call.
    """

    def get_call_template(self, args: Sequence[Any], kws: Any) -> Any:
        find: Any = super().get_call_template
        plain: Any = types.unliteral
        return find([plain(a) for a in args], {name: plain(a) for name, a in kws.items()})


class _OutsideCompiler(Compiler):
    """numba's, and hands the code that was linked the environments that its exceptions are made in."""

    def compile_extra(self, func: Callable[..., object]) -> Any:
        library: Any = _OutsideLibrary
        self.state.library = library(self.state.targetctx.codegen(), func.__qualname__)
        self.state.library.enable_object_caching()
        compile_extra: Any = super().compile_extra
        found = compile_extra(func)
        for environment in found._find_referenced_environments():
            found.library.codegen.set_env(environment.env_name, environment)
        return found


class _OutsideLibrary(JITCodeLibrary):
    """Code that Python calls, and nothing is linked with: machine code is all that is kept of it."""

    def _get_module_for_linking(self) -> Any:
        return binding.parse_assembly("")


class KeptKernel(CompileResultCacheImpl):
    """What is kept of a kernel; read without importing the parts of numba that it was compiled from."""

    def reduce(self, cres: Any) -> Any:
        """To what is pickled."""
        *rest, environments = cres._reduce()
        return (*rest, [(e.globals["__name__"], e.consts, e.env_name) for e in environments])

    def rebuild(self, target_context: Any, payload: Any) -> Any:
        """From what was pickled."""
        library, description, *rest, environments = payload
        # the engine takes no symbol for there that it was not told of; numba tells it those of the code for linking
        defined = target_context.codegen()._engine._defined_symbols
        defined |= {description.llvm_func_name, description.llvm_cpython_wrapper_name}
        rebuild: Any = super().rebuild
        kept = [_environment(*parts) for parts in environments]
        return rebuild(target_context, (library, description, *rest, kept))


def _environment(module: str, constants: list[object], name: str) -> Any:
    """What linked code makes its exceptions of: constants; the module's name is enough of what else numba has there."""
    look: Any = lookup_environment
    found = look(name)
    if found is None:
        found = Environment({"__name__": module})
        found.consts[:] = constants
        found.env_name = name
        Environment._memo[name] = found
    return found


class _InsideCompiler(Compiler):
    """Compiles as far as the code that callers link."""

    def compile_extra(self, func: Callable[..., object]) -> Any:
        context = self.state.targetctx
        library: Any = _InsideLibrary
        self.state.library = library(context.codegen(), func.__qualname__)
        self.state.flags.no_compile = True
        compile_extra: Any = super().compile_extra
        found = compile_extra(func)
        description, kept = found.fndesc, (found.library,)
        key = make_function(description.lookup_module(), func.__name__, "", 0, found.environment, kept)
        context.insert_user_function(key, description, kept)  # a name for it alone: there is nothing to be called
        return found._replace(entry_point=key)


class _InsideLibrary(JITCodeLibrary):
    """Code that is linked into others, where it is optimized and made into the machine's."""

    def _optimize_final_module(self) -> None:
        """Left to the caller."""

    def _finalize_final_module(self) -> None:
        find_globals: Any = self._finalize_dynamic_globals
        find_globals()
        self._finalized = True
