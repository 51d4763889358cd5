// The extension module _lockstep. lockstep/__init__.py shows what is public. SPDX-License-Identifier: Apache-2.0
#include <dlfcn.h>

#include "batch.h"

namespace lockstep::python {
namespace {

// pybind11 keeps its types in one place for all interpreters of a process.
void refuse_subinterpreter() {
  if (PyInterpreterState_Get() == PyInterpreterState_Main()) return;
  PyErr_SetString(PyExc_ImportError, "lockstep works in the main interpreter only; use threads or processes");
  throw py::error_already_set();
}

void load_kernel(const std::string& path) {
  if (dlopen(path.c_str(), RTLD_NOW | RTLD_GLOBAL)) return;
  throw UsageError("kernel '" + path + "'", std::string("cannot be loaded: ") + dlerror(),
                   "build it as a shared library with lockstep_add_kernel() of the same version");
}

}  // namespace

PYBIND11_MODULE(_lockstep, module) {
  refuse_subinterpreter();
  translate_errors();
  module.attr("__version__") = version();
  bind_batch(module);
  bind_plan(module);
  module.def("load_kernel", &load_kernel, py::arg("path"),
             "Loads generated kernels from a shared library. Batches that are made later use those of their plan.");
}

}  // namespace lockstep::python
