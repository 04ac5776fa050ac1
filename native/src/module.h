/* What the files of the extension module share. */
#ifndef GROUSER_MODULE_H
#define GROUSER_MODULE_H

#include <Python.h>

#include "grouser/dense.h"
#include "grouser/detector.h"
#include "grouser/fleet.h"
#include "grouser/ground.h"
#include "grouser/kernel.h"
#include "grouser/physics.h"
#include "level.h"

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

/* What every object that evaluates rows begins with. */
typedef struct {
  PyObject_HEAD
  grouser_kernel kernel;
} grouser_kernel_object;

/* Methods of such objects: forces(x, forces), forces_and_jacobian(x, forces, jacobian), track_forces(x_left, x_right,
 * track_forces[, jacobian]) and bind(x, forces[, jacobian]) -> step; the attribute `kernel`. */
#define GROUSER_KERNEL_METHODS                                                                                         \
  {"forces", (PyCFunction)(void (*)(void))grouser_object_forces, METH_FASTCALL,                                        \
   "forces(x, forces): write [Qx, Qy, Mz] of every row."},                                                             \
      {"forces_and_jacobian", (PyCFunction)(void (*)(void))grouser_object_forces_and_jacobian, METH_FASTCALL,          \
       "forces_and_jacobian(x, forces, jacobian): write forces and their derivatives by every column."},               \
      {"bind", (PyCFunction)(void (*)(void))grouser_object_bind, METH_FASTCALL,                                        \
       "bind(x, forces[, jacobian]): return step(), which evaluates the rows held in these arrays into them."},       \
      {"time_calls", (PyCFunction)(void (*)(void))grouser_object_time_calls, METH_FASTCALL,                            \
       "time_calls(x, calls, want_jacobian): return ns a call, one row after another, each waiting for the last."}
#define GROUSER_TRACK_METHODS                                                                                          \
  {"track_forces", (PyCFunction)(void (*)(void))grouser_object_track_forces, METH_FASTCALL,                            \
   "track_forces(x_left, x_right, track_forces[, jacobian]): write [Fx, Fy, M] of each track, and its derivatives by\n" \
   "every column of its own input."}
PyObject *grouser_object_forces(PyObject *self, PyObject *const *arguments, Py_ssize_t count);
PyObject *grouser_object_forces_and_jacobian(PyObject *self, PyObject *const *arguments, Py_ssize_t count);
PyObject *grouser_object_track_forces(PyObject *self, PyObject *const *arguments, Py_ssize_t count);
PyObject *grouser_object_bind(PyObject *self, PyObject *const *arguments, Py_ssize_t count);
PyObject *grouser_object_time_calls(PyObject *self, PyObject *const *arguments, Py_ssize_t count);
PyObject *grouser_object_capsule(PyObject *self, void *unused);
int grouser_add_bound_type(PyObject *module);

/* The level that the kernels run at: the best that the processor has, or the one that GROUSER_CPU names. */
const grouser_level *grouser_chosen_level(void);

/* 1 and an error raised if the kernel refuses a row. */
int grouser_kernel_refuses(const grouser_kernel *kernel, const grouser_array *x);

/* 1 and an error raised if two arrays share memory; `b` is called `what`. */
int grouser_arrays_overlap(const grouser_array *a, const grouser_array *b, const char *what);

/* 1, or 0 and an error raised: `b`, called `what`, must have the rows of `a`. */
int grouser_same_rows(const grouser_array *a, const grouser_array *b, const char *what);

/* Copies `count` float64 values of an array into `out`; -1 and an error raised if it holds another number. */
int grouser_copy_doubles(PyObject *object, const char *name, Py_ssize_t count, double *out);

/* Reads activation, widths and packed float32 parameters into a network, and returns the memory that it points into, to
 * be freed with PyMem_Free; or NULL and an error raised. */
void *grouser_read_dense(int activation, PyObject *widths, PyObject *parameters, grouser_dense *net);

/* Checks and copies the fields of a block; -1 and an error raised if one is out of range. */
int grouser_read_block(int mode, int contact, int path, grouser_physics *block);

#define GROUSER_DETECTOR_CAPSULE "grouser.detector"
#define GROUSER_FIELD_CAPSULE "grouser.field"
#define GROUSER_RULES_CAPSULE "grouser.rules"
#define GROUSER_FLEET_CAPSULE "grouser.fleet"

struct grouser_pool;

/* A fleet whose arrays an object holds, and what whoever advances it has to look at. */
typedef struct {
  const grouser_fleet *fleet;
  struct grouser_pool *pool;
  int *advancing;            /* set while a thread is at it */
  const int *without_ground; /* vehicles that must not be advanced yet */
} grouser_fleet_hold;

/* What the capsule in an object's attribute points to, valid as long as the object; or NULL and an error raised. */
const void *grouser_pointer_of(PyObject *object, const char *attribute, const char *capsule);

int grouser_add_physics_type(PyObject *module);
int grouser_add_mlp_type(PyObject *module);
int grouser_add_track_net_type(PyObject *module);
int grouser_add_gated_type(PyObject *module);
int grouser_add_detector_type(PyObject *module);
int grouser_add_field_type(PyObject *module);
int grouser_add_fleet_type(PyObject *module);
int grouser_add_rules_types(PyObject *module);
int grouser_add_episodes_type(PyObject *module);

#endif
