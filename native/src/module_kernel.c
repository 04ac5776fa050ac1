#include "grouser/interface.h"
#include "module.h"

const void *grouser_pointer_of(PyObject *object, const char *attribute, const char *capsule_name) {
  PyObject *capsule = PyObject_GetAttrString(object, attribute);
  if (!capsule) return NULL;
  const void *pointer = PyCapsule_GetPointer(capsule, capsule_name);
  Py_DECREF(capsule);
  return pointer;
}

int grouser_same_rows(const grouser_array *a, const grouser_array *b, const char *what) {
  if (a->rows == b->rows) return 1;
  PyErr_Format(PyExc_ValueError, "%s must have as many rows as the input: %zd, got %zd", what, a->rows, b->rows);
  return 0;
}

int grouser_kernel_refuses(const grouser_kernel *kernel, const grouser_array *x) {
  for (Py_ssize_t row = 0; row < x->rows; row++) {
    const char *name = kernel->refuses(kernel->self, x->data + row * kernel->columns);
    if (name) {
      PyErr_Format(PyExc_ValueError, "row %zd: column %s is not finite, or out of the block's domain", row, name);
      return 1;
    }
  }
  return 0;
}

static void evaluate_rows(const grouser_kernel *kernel, const grouser_array *x, double *forces, double *jacobian) {
  for (Py_ssize_t row = 0; row < x->rows; row++)
    kernel->evaluate(kernel->self, x->data + row * kernel->columns, forces + row * GROUSER_OUTPUTS,
                     jacobian ? jacobian + row * GROUSER_OUTPUTS * kernel->columns : NULL);
}

PyObject *grouser_kernel_call(const grouser_kernel *kernel, PyObject *x_object, PyObject *forces_object,
                              PyObject *jacobian_object) {
  grouser_array x, forces, jacobian;
  PyObject *result = NULL;
  if (grouser_array_acquire(x_object, "x", kernel->columns, 0, &x) < 0) return NULL;
  if (grouser_array_acquire(forces_object, "forces", GROUSER_OUTPUTS, 1, &forces) < 0) goto release_x;
  if (jacobian_object &&
      grouser_array_acquire(jacobian_object, "jacobian", GROUSER_OUTPUTS * kernel->columns, 1, &jacobian) < 0)
    goto release_forces;
  if (grouser_same_rows(&x, &forces, "forces") &&
      (!jacobian_object || grouser_same_rows(&x, &jacobian, "jacobian")) && !grouser_kernel_refuses(kernel, &x)) {
    double *slopes = jacobian_object ? jacobian.data : NULL;
    if (x.rows >= GROUSER_BATCH_ROWS) {
      Py_BEGIN_ALLOW_THREADS
      evaluate_rows(kernel, &x, forces.data, slopes);
      Py_END_ALLOW_THREADS
    } else {
      evaluate_rows(kernel, &x, forces.data, slopes);
    }
    result = Py_NewRef(Py_None);
  }
  if (jacobian_object) grouser_array_release(&jacobian);
release_forces:
  grouser_array_release(&forces);
release_x:
  grouser_array_release(&x);
  return result;
}

static void evaluate_tracks(const grouser_kernel *kernel, const grouser_array *left, const grouser_array *right,
                            double *tracks, double *jacobian) {
  const Py_ssize_t entries = GROUSER_OUTPUTS * kernel->columns;
  const grouser_array *sides[] = {left, right};
  for (Py_ssize_t row = 0; row < left->rows; row++)
    for (int side = 0; side < 2; side++)
      kernel->evaluate_track(kernel->self, sides[side]->data + row * kernel->columns, side,
                             tracks + (2 * row + side) * GROUSER_OUTPUTS,
                             jacobian ? jacobian + (2 * row + side) * entries : NULL);
}

PyObject *grouser_kernel_call_tracks(const grouser_kernel *kernel, PyObject *left_object, PyObject *right_object,
                                     PyObject *tracks_object, PyObject *jacobian_object) {
  PyObject *result = NULL;
  grouser_array left, right, tracks, jacobian = {.data = NULL};
  if (grouser_array_acquire(left_object, "x_left", kernel->columns, 0, &left) < 0) return NULL;
  if (grouser_array_acquire(right_object, "x_right", kernel->columns, 0, &right) < 0) goto release_left;
  if (grouser_array_acquire(tracks_object, "track_forces", 2 * GROUSER_OUTPUTS, 1, &tracks) < 0) goto release_right;
  if (jacobian_object &&
      grouser_array_acquire(jacobian_object, "jacobian", 2 * GROUSER_OUTPUTS * kernel->columns, 1, &jacobian) < 0)
    goto release_tracks;
  if (grouser_same_rows(&left, &right, "x_right") && grouser_same_rows(&left, &tracks, "track_forces") &&
      (!jacobian_object || grouser_same_rows(&left, &jacobian, "jacobian")) &&
      !grouser_kernel_refuses(kernel, &left) && !grouser_kernel_refuses(kernel, &right)) {
    if (left.rows >= GROUSER_BATCH_ROWS) {
      Py_BEGIN_ALLOW_THREADS
      evaluate_tracks(kernel, &left, &right, tracks.data, jacobian.data);
      Py_END_ALLOW_THREADS
    } else {
      evaluate_tracks(kernel, &left, &right, tracks.data, jacobian.data);
    }
    result = Py_NewRef(Py_None);
  }
  if (jacobian_object) grouser_array_release(&jacobian);
release_tracks:
  grouser_array_release(&tracks);
release_right:
  grouser_array_release(&right);
release_left:
  grouser_array_release(&left);
  return result;
}
