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

/* Rows and what is written for them: x, forces and, if there are three, the jacobian. */
typedef struct {
  grouser_array x, forces, jacobian;
  int held;
} call_arrays;

static void release_arrays(call_arrays *arrays) {
  grouser_array *each[] = {&arrays->x, &arrays->forces, &arrays->jacobian};
  for (int n = 0; n < arrays->held; n++) grouser_array_release(each[n]);
  arrays->held = 0;
}

/* Acquires `count` arrays for a kernel and returns 0, or raises and returns -1, holding none. */
static int hold_arrays(const grouser_kernel *kernel, PyObject *const *arguments, Py_ssize_t count,
                       call_arrays *arrays) {
  static const char *const names[] = {"x", "forces", "jacobian"};
  grouser_array *each[] = {&arrays->x, &arrays->forces, &arrays->jacobian};
  const Py_ssize_t row_sizes[] = {kernel->columns, GROUSER_OUTPUTS, GROUSER_OUTPUTS * kernel->columns};
  arrays->held = 0;
  arrays->jacobian.data = NULL;
  for (int n = 0; n < count; n++) {
    if (grouser_array_acquire(arguments[n], names[n], row_sizes[n], n > 0, each[n]) < 0) goto refused;
    arrays->held = n + 1;
    if (n > 0 && !grouser_same_rows(each[0], each[n], names[n])) goto refused;
    for (int other = 0; other < n; other++)
      if (grouser_arrays_overlap(each[other], each[n], names[n])) goto refused;
  }
  return 0;
refused:
  release_arrays(arrays);
  return -1;
}

static PyObject *call(const grouser_kernel *kernel, PyObject *const *arguments, Py_ssize_t count) {
  call_arrays arrays;
  PyObject *result = NULL;
  if (hold_arrays(kernel, arguments, count, &arrays) < 0) return NULL;
  const Py_ssize_t rows = arrays.x.rows;
  if (!grouser_kernel_refuses(kernel, &arrays.x)) {
    if (rows >= GROUSER_BATCH_ROWS) {
      Py_BEGIN_ALLOW_THREADS
      evaluate_rows(kernel, arrays.x.data, rows, arrays.forces.data, arrays.jacobian.data);
      Py_END_ALLOW_THREADS
    } else {
      evaluate_rows(kernel, arrays.x.data, rows, arrays.forces.data, arrays.jacobian.data);
    }
    result = Py_NewRef(Py_None);
  }
  release_arrays(&arrays);
  return result;
}

static int takes(Py_ssize_t count, Py_ssize_t least, Py_ssize_t most, const char *what) {
  if (count >= least && count <= most) return 1;
  PyErr_Format(PyExc_TypeError, "%s takes %zd%s arrays, got %zd", what, least, least == most ? "" : " or more", count);
  return 0;
}

PyObject *grouser_object_forces(PyObject *self, PyObject *const *arguments, Py_ssize_t count) {
  return takes(count, 2, 2, "forces") ? call(kernel_of(self), arguments, count) : NULL;
}

PyObject *grouser_object_forces_and_jacobian(PyObject *self, PyObject *const *arguments, Py_ssize_t count) {
  return takes(count, 3, 3, "forces_and_jacobian") ? call(kernel_of(self), arguments, count) : NULL;
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
  call_arrays arrays;
} bound_object;

static PyObject *bound_step(PyObject *self, PyObject *unused) {
  (void)unused;
  const bound_object *bound = (const bound_object *)self;
  const grouser_kernel *kernel = kernel_of(bound->owner);
  const call_arrays *arrays = &bound->arrays;
  if (grouser_kernel_refuses(kernel, &arrays->x)) return NULL;
  evaluate_rows(kernel, arrays->x.data, arrays->x.rows, arrays->forces.data, arrays->jacobian.data);
  return Py_NewRef(Py_None);
}

static PyMethodDef bound_call = {"step", bound_step, METH_NOARGS,
                                 "step(): evaluate the rows of the bound arrays into the bound arrays."};

static void bound_dealloc(PyObject *self) {
  PyTypeObject *type = Py_TYPE(self);
  bound_object *bound = (bound_object *)self;
  release_arrays(&bound->arrays);
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
  if (hold_arrays(kernel, arguments, count, &bound->arrays) == 0) {
    bound->owner = Py_NewRef(self);
    step = PyCFunction_New(&bound_call, (PyObject *)bound);
  }
  Py_DECREF(bound);
  return step;
}
