#include <stdint.h>
#include <string.h>

#include "module.h"

int grouser_array_acquire(PyObject *object, const char *name, Py_ssize_t row_size, int writable, grouser_array *array) {
  const int flags = PyBUF_C_CONTIGUOUS | PyBUF_FORMAT | (writable ? PyBUF_WRITABLE : 0);
  if (PyObject_GetBuffer(object, &array->view, flags) < 0) {
    PyErr_Format(PyExc_ValueError, "%s must be a C-contiguous%s float64 array", name, writable ? ", writable" : "");
    return -1;
  }
  const char *format = array->view.format;
  const Py_ssize_t count = array->view.len / (Py_ssize_t)sizeof(double);
  if (!format || strcmp(format, "d") != 0 || ((uintptr_t)array->view.buf) % sizeof(double) != 0) {
    PyErr_Format(PyExc_ValueError, "%s must be an aligned float64 array, got format '%s'", name, format ? format : "B");
  } else if (count % row_size != 0) {
    PyErr_Format(PyExc_ValueError, "%s must hold rows of %zd values, got %zd values", name, row_size, count);
  } else {
    array->data = array->view.buf;
    array->rows = count / row_size;
    return 0;
  }
  PyBuffer_Release(&array->view);
  return -1;
}

void grouser_array_release(grouser_array *array) { PyBuffer_Release(&array->view); }

int grouser_arrays_overlap(const grouser_array *a, const grouser_array *b, const char *what) {
  const uintptr_t from = (uintptr_t)a->data, to = (uintptr_t)b->data;
  if (from >= to + (uintptr_t)b->view.len || to >= from + (uintptr_t)a->view.len) return 0;
  PyErr_Format(PyExc_ValueError, "%s must not share memory with another array of the call", what);
  return 1;
}
