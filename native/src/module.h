/* What the files of the extension module share. */
#ifndef GROUSER_MODULE_H
#define GROUSER_MODULE_H

#include <Python.h>

/* A float64, C-contiguous view of a caller's array; rows = elements / row_size. */
typedef struct {
  Py_buffer view;
  double *data;
  Py_ssize_t rows;
} grouser_array;

/* Fills `array` and returns 0, or raises ValueError and returns -1. Release with grouser_array_release. */
int grouser_array_acquire(PyObject *object, const char *name, Py_ssize_t row_size, int writable, grouser_array *array);
void grouser_array_release(grouser_array *array);

/* Rows from which a batch releases the GIL. */
enum { GROUSER_BATCH_ROWS = 16 };

int grouser_add_physics_type(PyObject *module);
int grouser_add_mlp_type(PyObject *module);

#endif
