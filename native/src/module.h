/* What the files of the extension module share. */
#ifndef GROUSER_MODULE_H
#define GROUSER_MODULE_H

#include <Python.h>

#include "grouser/dense.h"
#include "grouser/detector.h"
#include "grouser/ground.h"
#include "grouser/kernel.h"
#include "grouser/physics.h"

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

/* Evaluates every row into the caller's arrays and returns None, or raises ValueError; jacobian may be NULL. */
PyObject *grouser_kernel_call(const grouser_kernel *kernel, PyObject *x, PyObject *forces, PyObject *jacobian);

/* Evaluates every row of both tracks, each from its own input, into tracks (2 x 3 a row) and, unless NULL, jacobian
 * (2 x 3 x columns a row). */
PyObject *grouser_kernel_call_tracks(const grouser_kernel *kernel, PyObject *left, PyObject *right, PyObject *tracks,
                                     PyObject *jacobian);

/* 1 and an error raised if the kernel refuses a row. */
int grouser_kernel_refuses(const grouser_kernel *kernel, const grouser_array *x);

/* 1, or 0 and an error raised: `b`, called `what`, must have the rows of `a`. */
int grouser_same_rows(const grouser_array *a, const grouser_array *b, const char *what);

/* Copies `count` float64 values of an array into `out`; -1 and an error raised if it holds another number. */
int grouser_copy_doubles(PyObject *object, const char *name, Py_ssize_t count, double *out);

/* Reads activation, widths and packed float32 parameters into a network, and returns the copy that it points into, to
 * be freed with PyMem_Free; or NULL and an error raised. */
float *grouser_read_dense(int activation, PyObject *widths, PyObject *parameters, grouser_dense *net);

/* Checks and copies the fields of a block; -1 and an error raised if one is out of range. */
int grouser_read_block(int mode, int contact, int path, grouser_physics *block);

/* Name of the capsule that every compiled force function hands out as its attribute `kernel`. */
#define GROUSER_KERNEL_CAPSULE "grouser.kernel"

#define GROUSER_DETECTOR_CAPSULE "grouser.detector"
#define GROUSER_FIELD_CAPSULE "grouser.field"

/* What the capsule in an object's attribute points to, valid as long as the object; or NULL and an error raised. */
const void *grouser_pointer_of(PyObject *object, const char *attribute, const char *capsule);

int grouser_add_physics_type(PyObject *module);
int grouser_add_mlp_type(PyObject *module);
int grouser_add_track_net_type(PyObject *module);
int grouser_add_detector_type(PyObject *module);
int grouser_add_field_type(PyObject *module);
int grouser_add_fleet_type(PyObject *module);

#endif
