// Exceptions of lockstep as those of lockstep/errors.py. SPDX-License-Identifier: Apache-2.0
#include "convert.h"

namespace lockstep::python {
namespace {

void raise(const char* type, const Error& error) {
  py::list others;
  for (const Reason& reason : error.reasons())
    others.append(py::make_tuple(reason.element, reason.rule, reason.remedy));
  others.attr("pop")(0);
  const py::object exception = py::module_::import("lockstep.errors")
                                   .attr(type)(error.element(), error.rule(), error.remedy(), error.code(), others);
  PyErr_SetObject(reinterpret_cast<PyObject*>(Py_TYPE(exception.ptr())), exception.ptr());
}

}  // namespace

void translate_errors() {
  py::register_exception_translator([](std::exception_ptr thrown) {
    try {
      if (thrown) std::rethrow_exception(thrown);
    } catch (const ModelError& error) {
      raise("ModelError", error);
    } catch (const ImportError& error) {
      raise("ImportFileError", error);
    } catch (const SettingsError& error) {
      raise("SettingsError", error);
    } catch (const UsageError& error) {
      raise("UsageError", error);
    } catch (const py::cast_error&) {
      PyErr_SetString(PyExc_TypeError, "an argument has a value of a wrong type");
    }
  });
}

}  // namespace lockstep::python
