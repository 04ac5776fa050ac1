#include <string.h>

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

static const grouser_kernel *kernel_of(PyObject *self) { return &((grouser_kernel_object *)self)->kernel; }

static void evaluate_rows(const grouser_kernel *kernel, const double *x, Py_ssize_t rows, double *forces,
                          double *jacobian) {
  if (!jacobian && kernel->evaluate_rows && rows >= GROUSER_BATCH_ROWS) {
    kernel->evaluate_rows(kernel->self, x, rows, forces);
    return;
  }
  for (Py_ssize_t row = 0; row < rows; row++)
    kernel->evaluate(kernel->self, x + row * kernel->columns, forces + row * GROUSER_OUTPUTS,
                     jacobian ? jacobian + row * GROUSER_OUTPUTS * kernel->columns : NULL);
}

static PyObject *call(const grouser_kernel *kernel, PyObject *const *arguments, int want_jacobian) {
  grouser_array x, forces, jacobian = {.data = NULL};
  PyObject *result = NULL;
  if (grouser_array_acquire(arguments[0], "x", kernel->columns, 0, &x) < 0) return NULL;
  if (grouser_array_acquire(arguments[1], "forces", GROUSER_OUTPUTS, 1, &forces) < 0) goto release_x;
  if (want_jacobian &&
      grouser_array_acquire(arguments[2], "jacobian", GROUSER_OUTPUTS * kernel->columns, 1, &jacobian) < 0)
    goto release_forces;
  if (grouser_same_rows(&x, &forces, "forces") && (!want_jacobian || grouser_same_rows(&x, &jacobian, "jacobian")) &&
      !grouser_arrays_overlap(&x, &forces, "forces") &&
      (!want_jacobian ||
       (!grouser_arrays_overlap(&x, &jacobian, "jacobian") && !grouser_arrays_overlap(&forces, &jacobian, "jacobian"))) &&
      !grouser_kernel_refuses(kernel, &x)) {
    if (x.rows >= GROUSER_BATCH_ROWS) {
      Py_BEGIN_ALLOW_THREADS
      evaluate_rows(kernel, x.data, x.rows, forces.data, jacobian.data);
      Py_END_ALLOW_THREADS
    } else {
      evaluate_rows(kernel, x.data, x.rows, forces.data, jacobian.data);
    }
    result = Py_NewRef(Py_None);
  }
  if (want_jacobian) grouser_array_release(&jacobian);
release_forces:
  grouser_array_release(&forces);
release_x:
  grouser_array_release(&x);
  return result;
}

static int takes(Py_ssize_t count, Py_ssize_t least, Py_ssize_t most, const char *what) {
  if (count >= least && count <= most) return 1;
  PyErr_Format(PyExc_TypeError, "%s takes %zd%s arrays, got %zd", what, least, least == most ? "" : " or more", count);
  return 0;
}

PyObject *grouser_object_forces(PyObject *self, PyObject *const *arguments, Py_ssize_t count) {
  return takes(count, 2, 2, "forces") ? call(kernel_of(self), arguments, 0) : NULL;
}

PyObject *grouser_object_forces_and_jacobian(PyObject *self, PyObject *const *arguments, Py_ssize_t count) {
  return takes(count, 3, 3, "forces_and_jacobian") ? call(kernel_of(self), arguments, 1) : NULL;
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

PyObject *grouser_object_track_forces(PyObject *self, PyObject *const *arguments, Py_ssize_t count) {
  const grouser_kernel *kernel = kernel_of(self);
  PyObject *result = NULL;
  grouser_array left, right, tracks, jacobian = {.data = NULL};
  if (!takes(count, 3, 4, "track_forces")) return NULL;
  PyObject *jacobian_object = count > 3 ? arguments[3] : NULL;
  if (grouser_array_acquire(arguments[0], "x_left", kernel->columns, 0, &left) < 0) return NULL;
  if (grouser_array_acquire(arguments[1], "x_right", kernel->columns, 0, &right) < 0) goto release_left;
  if (grouser_array_acquire(arguments[2], "track_forces", 2 * GROUSER_OUTPUTS, 1, &tracks) < 0) goto release_right;
  if (jacobian_object &&
      grouser_array_acquire(jacobian_object, "jacobian", 2 * GROUSER_OUTPUTS * kernel->columns, 1, &jacobian) < 0)
    goto release_tracks;
  if (grouser_same_rows(&left, &right, "x_right") && grouser_same_rows(&left, &tracks, "track_forces") &&
      (!jacobian_object || grouser_same_rows(&left, &jacobian, "jacobian")) &&
      !grouser_arrays_overlap(&left, &tracks, "track_forces") &&
      !grouser_arrays_overlap(&right, &tracks, "track_forces") && !grouser_kernel_refuses(kernel, &left) &&
      !grouser_kernel_refuses(kernel, &right)) {
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

PyObject *grouser_object_capsule(PyObject *self, void *unused) {
  (void)unused;
  return PyCapsule_New((void *)kernel_of(self), GROUSER_KERNEL_CAPSULE, NULL);
}

/* A kernel with the arrays that it reads and writes, held until it goes. */
typedef struct {
  PyObject_HEAD
  PyObject *owner;
  grouser_array x, forces, jacobian;
  int held;
} bound_object;

static PyObject *bound_step(PyObject *self, PyObject *unused) {
  (void)unused;
  const bound_object *bound = (const bound_object *)self;
  const grouser_kernel *kernel = kernel_of(bound->owner);
  if (grouser_kernel_refuses(kernel, &bound->x)) return NULL;
  evaluate_rows(kernel, bound->x.data, bound->x.rows, bound->forces.data, bound->held > 2 ? bound->jacobian.data : NULL);
  return Py_NewRef(Py_None);
}

static PyMethodDef bound_call = {"step", bound_step, METH_NOARGS,
                                 "step(): evaluate the rows of the bound arrays into the bound arrays."};

static void bound_dealloc(PyObject *self) {
  PyTypeObject *type = Py_TYPE(self);
  bound_object *bound = (bound_object *)self;
  grouser_array *arrays[] = {&bound->x, &bound->forces, &bound->jacobian};
  for (int n = 0; n < bound->held; n++) grouser_array_release(arrays[n]);
  Py_XDECREF(bound->owner);
  freefunc release = (freefunc)PyType_GetSlot(type, Py_tp_free);
  release(self);
  Py_DECREF(type);
}

static PyType_Slot bound_slots[] = {{Py_tp_dealloc, bound_dealloc},
                                    {Py_tp_doc, "A kernel with the arrays that it reads and writes."},
                                    {0, NULL}};

static PyType_Spec bound_spec = {"grouser.native._core.BoundKernel", sizeof(bound_object), 0,
                                 Py_TPFLAGS_DEFAULT | Py_TPFLAGS_DISALLOW_INSTANTIATION, bound_slots};

int grouser_add_bound_type(PyObject *module) {
  PyObject *type = PyType_FromSpec(&bound_spec);
  if (!type) return -1;
  const int status = PyModule_AddObjectRef(module, "BoundKernel", type);
  Py_DECREF(type);
  return status;
}

PyObject *grouser_object_bind(PyObject *self, PyObject *const *arguments, Py_ssize_t count) {
  if (!takes(count, 2, 3, "bind")) return NULL;
  const grouser_kernel *kernel = kernel_of(self);
  PyObject *module = PyType_GetModule(Py_TYPE(self));
  PyObject *type = module ? PyObject_GetAttrString(module, "BoundKernel") : NULL;
  if (!type) return NULL;
  allocfunc allocate = (allocfunc)PyType_GetSlot((PyTypeObject *)type, Py_tp_alloc);
  bound_object *bound = (bound_object *)allocate((PyTypeObject *)type, 0);
  Py_DECREF(type);
  if (!bound) return NULL;
  PyObject *step = NULL;
  if (grouser_array_acquire(arguments[0], "x", kernel->columns, 0, &bound->x) < 0) goto done;
  bound->held = 1;
  if (grouser_array_acquire(arguments[1], "forces", GROUSER_OUTPUTS, 1, &bound->forces) < 0) goto done;
  bound->held = 2;
  if (!grouser_same_rows(&bound->x, &bound->forces, "forces") ||
      grouser_arrays_overlap(&bound->x, &bound->forces, "forces"))
    goto done;
  if (count > 2) {
    if (grouser_array_acquire(arguments[2], "jacobian", GROUSER_OUTPUTS * kernel->columns, 1, &bound->jacobian) < 0)
      goto done;
    bound->held = 3;
    if (!grouser_same_rows(&bound->x, &bound->jacobian, "jacobian") ||
        grouser_arrays_overlap(&bound->x, &bound->jacobian, "jacobian") ||
        grouser_arrays_overlap(&bound->forces, &bound->jacobian, "jacobian"))
      goto done;
  }
  bound->owner = Py_NewRef(self);
  step = PyCFunction_New(&bound_call, (PyObject *)bound);
done:
  Py_DECREF(bound);
  return step;
}
