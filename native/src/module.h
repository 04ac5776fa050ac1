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

/* A force function of rows, and what it cannot take. */
typedef struct {
  const void *self;
  int columns;
  /* Writes forces (3) and, unless NULL, the jacobian (3 x columns) of one row. */
  void (*evaluate)(const void *self, const double *x, double *forces, double *jacobian);
  /* Name of the first column that is not finite or out of the function's domain, or NULL. */
  const char *(*refuses)(const void *self, const double *x);
} grouser_kernel;

/* Evaluates every row into the caller's arrays and returns None, or raises ValueError; jacobian may be NULL. */
PyObject *grouser_kernel_call(const grouser_kernel *kernel, PyObject *x, PyObject *forces, PyObject *jacobian);

/* 1 and an error raised if the kernel refuses a row. */
int grouser_kernel_refuses(const grouser_kernel *kernel, const grouser_array *x);

/* 1, or 0 and an error raised: `b`, called `what`, must have the rows of `a`. */
int grouser_same_rows(const grouser_array *a, const grouser_array *b, const char *what);

int grouser_add_physics_type(PyObject *module);
int grouser_add_mlp_type(PyObject *module);

#endif
