"""How a compiled kernel is loaded from disk: numba parses its intermediate code at once, this when needed."""

from typing import Any

import llvmlite.binding as llvm
from numba.core.codegen import JITCodeLibrary


class KernelLibrary(JITCodeLibrary):
    """The machine code of a kernel, and its bitcode, which only the compiler of a calling kernel needs.

    The parsed bitcode of the robot's kernels would take 20 MB.
    """

    _bitcode: bytes | None = None  # of a kernel from disk

    @classmethod
    def _unserialize(cls, codegen: Any, state: tuple[str, str, tuple[bytes, bytes]]) -> "KernelLibrary":
        """Return the library that `serialize_using_object_code` wrote."""
        name, _, (machine_code, bitcode) = state
        library = cls(codegen, name)
        library._bitcode = bitcode
        library.enable_object_caching()  # type: ignore[no-untyped-call]
        library._set_compiled_object(machine_code)  # type: ignore[no-untyped-call]
        library._finalize_final_module()  # type: ignore[no-untyped-call]
        return library

    def get_pointer_to_function(self, name: str) -> int:
        """Return the address of a function; numba does not know those that it did not parse."""
        if self._bitcode is None:
            return int(super().get_pointer_to_function(name))  # type: ignore[no-untyped-call]
        return int(self._codegen._engine.get_function_address(name))

    def _get_module_for_linking(self) -> Any:
        if self._shared_module is None and self._bitcode is not None:
            self._shared_module = llvm.parse_bitcode(self._bitcode)
            self._codegen._engine._load_defined_symbols(self._shared_module)  # type: ignore[no-untyped-call]
        return super()._get_module_for_linking()  # type: ignore[no-untyped-call]
