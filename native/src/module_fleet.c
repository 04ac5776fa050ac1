#include <limits.h>
#include <math.h>
#include <string.h>

#include "grouser/fleet.h"
#include "module.h"
#include "threads.h"

enum { MOST_VEHICLES = 1 << 24 };

typedef struct {
  PyObject_HEAD
  grouser_fleet fleet;
  grouser_plant plant;
  grouser_guard guard;
  grouser_pool pool;
  grouser_fleet_hold hold;
  int pooled, advancing, without_ground;
  grouser_ground *grounds;
  grouser_traits *traits;
  PyObject **fields;                  /* that the grounds point into, one a vehicle, or NULL */
  PyObject *kernel, *fallback;        /* that the plant and the guard point into */
  grouser_array state, memory, record;
  Py_buffer status;
} fleet_object;

static int acquire_status(PyObject *object, Py_buffer *view) {
  if (PyObject_GetBuffer(object, view, PyBUF_C_CONTIGUOUS | PyBUF_FORMAT | PyBUF_WRITABLE) < 0) {
    view->obj = NULL;
    PyErr_SetString(PyExc_ValueError, "status must be a C-contiguous, writable uint8 array");
    return -1;
  }
  if (view->itemsize == 1 && view->format && strcmp(view->format, "B") == 0) return 0;
  PyErr_Format(PyExc_ValueError, "status must be a uint8 array, got format '%s'", view->format ? view->format : "B");
  return -1;
}

static int overlap(const Py_buffer *a, const Py_buffer *b) {
  const char *a_first = a->buf, *b_first = b->buf;
  return a_first < b_first + b->len && b_first < a_first + a->len;
}

/* Takes hold of the caller's arrays; -1 and an error raised if one does not fit. */
static int acquire_arrays(fleet_object *self, PyObject *state, PyObject *memory, PyObject *record, PyObject *status) {
  if (acquire_status(status, &self->status) < 0) return -1;
  const Py_ssize_t vehicles = self->status.len;
  if (vehicles < 1 || vehicles > MOST_VEHICLES) {
    PyErr_Format(PyExc_ValueError, "status must hold 1 to %d vehicles, got %zd", MOST_VEHICLES, vehicles);
    return -1;
  }
  if (grouser_array_acquire(state, "state", vehicles, 1, &self->state) < 0 ||
      grouser_array_acquire(memory, "guard", vehicles, 1, &self->memory) < 0 ||
      grouser_array_acquire(record, "record", vehicles, 1, &self->record) < 0)
    return -1;
  const struct {
    const char *name;
    Py_ssize_t rows, expected;
  } shapes[] = {{"state", self->state.rows, GROUSER_STATE_ROWS},
                {"guard", self->memory.rows, GROUSER_GUARD_ROWS},
                {"record", self->record.rows, GROUSER_RECORD_ROWS}};
  for (int n = 0; n < 3; n++)
    if (shapes[n].rows != shapes[n].expected) {
      PyErr_Format(PyExc_ValueError, "%s must have %zd rows of %zd vehicles, got %zd", shapes[n].name,
                   shapes[n].expected, vehicles, shapes[n].rows);
      return -1;
    }
  const Py_buffer *views[] = {&self->state.view, &self->memory.view, &self->record.view, &self->status};
  for (int a = 0; a < 4; a++)
    for (int b = a + 1; b < 4; b++)
      if (overlap(views[a], views[b])) {
        PyErr_SetString(PyExc_ValueError, "state, guard, record and status must not overlap in memory");
        return -1;
      }
  self->fleet.vehicles = (int)vehicles;
  self->fleet.state = self->state.data;
  self->fleet.guard = self->memory.data;
  self->fleet.record = self->record.data;
  self->fleet.status = self->status.buf;
  return 0;
}

static int read_policy(PyObject *policy, grouser_switching_policy *out) {
  if (!PyArg_ParseTuple(policy, "iidddi:policy", &out->entry_votes, &out->entry_window, &out->exit_score,
                        &out->exit_time, &out->minimum_dwell, &out->blend_samples))
    return -1;
  if (out->entry_window < 1 || out->entry_window > GROUSER_MAX_ENTRY_WINDOW || out->entry_votes < 1 ||
      out->entry_votes > out->entry_window || out->blend_samples < 1) {
    PyErr_Format(PyExc_ValueError,
                 "entry_window must lie in [1, %d], entry_votes in [1, entry_window], blend_samples be at least 1",
                 GROUSER_MAX_ENTRY_WINDOW);
    return -1;
  }
  return 0;
}

/* Reads fallback, detector and policy where there is a fallback; -1 and an error raised if they do not fit. */
static int read_guard(fleet_object *self, const grouser_kernel *kernel, PyObject *fallback, PyObject *detector,
                      PyObject *policy, int tracks) {
  self->guard.fallback = grouser_pointer_of(fallback, "kernel", GROUSER_KERNEL_CAPSULE);
  if (!self->guard.fallback) return -1;
  const grouser_detector *source = grouser_pointer_of(detector, "detector", GROUSER_DETECTOR_CAPSULE);
  if (!source || read_policy(policy, &self->guard.policy) < 0) return -1;
  self->guard.detector = *source;
  self->fallback = Py_NewRef(fallback);
  if (tracks || self->guard.fallback->columns != kernel->columns || source->columns != kernel->columns) {
    PyErr_SetString(PyExc_ValueError, "kernel, fallback and detector of a guard must have the same columns, and it "
                                      "takes the ground under the whole vehicle");
    return -1;
  }
  return 0;
}

static int vehicle_is_possible(const grouser_vehicle *v, double step, double tolerance) {
  const double positive[] = {v->mass, v->yaw_inertia, v->tread, v->gravity, v->belt_time_constant, v->belt_acceleration,
                             step, tolerance};
  for (size_t n = 0; n < sizeof positive / sizeof *positive; n++)
    if (!(positive[n] > 0 && isfinite(positive[n]))) {
      PyErr_SetString(PyExc_ValueError, "mass, yaw_inertia, tread, gravity, belt_time_constant, belt_acceleration, "
                                        "tick and tolerance must be positive and finite");
      return 0;
    }
  if (isfinite(v->contact_center)) return 1;
  PyErr_SetString(PyExc_ValueError, "contact_center must be finite");
  return 0;
}

static int build(fleet_object *self, PyObject *arguments, PyObject *keywords) {
  static char *names[] = {"kernel",  "state",     "guard",          "record",  "status",
                          "mass",    "yaw_inertia", "tread",        "contact_center", "gravity",
                          "belt_time_constant", "belt_acceleration", "tick", "integrator", "tolerance",
                          "sample_tracks", "threads", "fallback",   "detector", "policy", NULL};
  grouser_vehicle vehicle;
  double step, tolerance;
  int integrator, tracks, threads;
  PyObject *kernel_object, *state, *memory, *record, *status;
  PyObject *fallback = Py_None, *detector = Py_None, *policy = Py_None;
  if (!PyArg_ParseTupleAndKeywords(arguments, keywords, "OOOOOddddddddidpi|OOO", names, &kernel_object, &state, &memory,
                                   &record, &status, &vehicle.mass, &vehicle.yaw_inertia, &vehicle.tread,
                                   &vehicle.contact_center, &vehicle.gravity, &vehicle.belt_time_constant,
                                   &vehicle.belt_acceleration, &step, &integrator, &tolerance, &tracks, &threads,
                                   &fallback, &detector, &policy))
    return -1;
  const grouser_kernel *kernel = grouser_pointer_of(kernel_object, "kernel", GROUSER_KERNEL_CAPSULE);
  if (!kernel) return -1;
  self->kernel = Py_NewRef(kernel_object);
  if (!vehicle_is_possible(&vehicle, step, tolerance)) return -1;
  if (integrator < GROUSER_IMPLICIT || integrator > GROUSER_EULER) {
    PyErr_SetString(PyExc_ValueError, "integrator must be 0 (implicit), 1 (sdirk2) or 2 (euler)");
    return -1;
  }
  if (tracks && !kernel->evaluate_track) {
    PyErr_SetString(PyExc_ValueError, "sample_tracks needs a kernel that knows the tracks apart");
    return -1;
  }
  if (threads < 1 || threads > GROUSER_MAX_THREADS) {
    PyErr_Format(PyExc_ValueError, "threads must lie in [1, %d], got %d", GROUSER_MAX_THREADS, threads);
    return -1;
  }
  const int guarded = fallback != Py_None;
  if (guarded && read_guard(self, kernel, fallback, detector, policy, tracks) < 0) return -1;
  if (acquire_arrays(self, state, memory, record, status) < 0) return -1;
  const size_t vehicles = (size_t)self->fleet.vehicles;
  self->grounds = PyMem_Calloc(vehicles, sizeof *self->grounds);
  self->traits = PyMem_Calloc(vehicles, sizeof *self->traits);
  self->fields = PyMem_Calloc(vehicles, sizeof *self->fields);
  if (!self->grounds || !self->traits || !self->fields) {
    PyErr_NoMemory();
    return -1;
  }
  grouser_plant_init(&self->plant, &vehicle, kernel, guarded ? &self->guard : NULL, tracks,
                     (enum grouser_integrator)integrator, step, tolerance);
  for (size_t n = 0; n < vehicles; n++) self->traits[n] = self->plant.traits;
  self->fleet.plant = &self->plant;
  self->fleet.grounds = self->grounds;
  self->fleet.traits = self->traits;
  self->fleet.advance_lanes = grouser_chosen_level()->advance_lanes;
  self->without_ground = self->fleet.vehicles;
  self->hold = (grouser_fleet_hold){&self->fleet, &self->pool, &self->advancing, &self->without_ground};
  self->pooled = grouser_pool_start(&self->pool, threads);
  if (self->pooled) return 0;
  PyErr_Format(PyExc_RuntimeError, "the system refused to start %d threads", threads);
  return -1;
}

static PyObject *fleet_new(PyTypeObject *type, PyObject *arguments, PyObject *keywords) {
  allocfunc allocate = (allocfunc)PyType_GetSlot(type, Py_tp_alloc);
  PyObject *self = allocate(type, 0);
  if (self && build((fleet_object *)self, arguments, keywords) < 0) Py_CLEAR(self);
  return self;
}

static void fleet_dealloc(PyObject *object) {
  fleet_object *self = (fleet_object *)object;
  PyTypeObject *type = Py_TYPE(object);
  if (self->pooled) grouser_pool_stop(&self->pool);
  for (int n = 0; self->fields && n < self->fleet.vehicles; n++) Py_XDECREF(self->fields[n]);
  PyMem_Free(self->fields);
  PyMem_Free(self->grounds);
  PyMem_Free(self->traits);
  grouser_array *arrays[] = {&self->state, &self->memory, &self->record};
  for (int n = 0; n < 3; n++)
    if (arrays[n]->data) grouser_array_release(arrays[n]);
  if (self->status.obj) PyBuffer_Release(&self->status);
  Py_XDECREF(self->kernel);
  Py_XDECREF(self->fallback);
  freefunc release = (freefunc)PyType_GetSlot(type, Py_tp_free);
  release(self);
  Py_DECREF(type);
}

static int is_idle(const fleet_object *self) {
  if (!self->advancing) return 1;
  PyErr_SetString(PyExc_RuntimeError, "the fleet is being advanced by another thread");
  return 0;
}

static int may_be_set(const fleet_object *self, Py_ssize_t vehicle) {
  if (!is_idle(self)) return 0;
  if (vehicle >= 0 && vehicle < self->fleet.vehicles) return 1;
  PyErr_Format(PyExc_ValueError, "vehicle must lie in [0, %d), got %zd", self->fleet.vehicles, vehicle);
  return 0;
}

static PyObject *fleet_set_traits(PyObject *object, PyObject *arguments) {
  fleet_object *self = (fleet_object *)object;
  grouser_vehicle own = self->plant.vehicle;
  Py_ssize_t vehicle;
  if (!PyArg_ParseTuple(arguments, "nddd:set_traits", &vehicle, &own.yaw_inertia, &own.belt_time_constant,
                        &own.belt_acceleration))
    return NULL;
  if (!may_be_set(self, vehicle) || !vehicle_is_possible(&own, self->plant.step, self->plant.tolerance)) return NULL;
  self->traits[vehicle] =
      grouser_traits_of(own.yaw_inertia, own.belt_time_constant, own.belt_acceleration, self->plant.step);
  return Py_NewRef(Py_None);
}

static PyObject *fleet_set_ground(PyObject *object, PyObject *arguments) {
  fleet_object *self = (fleet_object *)object;
  const int parameters = self->plant.kernel->columns - GROUSER_TERRAIN;
  Py_ssize_t vehicle;
  PyObject *theta_object, *field_object = Py_None;
  double theta[2 * GROUSER_MAX_PARAMETERS];
  grouser_ground ground;
  memset(&ground, 0, sizeof ground);
  if (!PyArg_ParseTuple(arguments, "nOdd|O:set_ground", &vehicle, &theta_object, &ground.slope_x, &ground.slope_y,
                        &field_object))
    return NULL;
  if (!may_be_set(self, vehicle)) return NULL;
  if (!(isfinite(ground.slope_x) && isfinite(ground.slope_y))) {
    PyErr_SetString(PyExc_ValueError, "slopes must be finite");
    return NULL;
  }
  if (field_object != Py_None) {
    ground.field = grouser_pointer_of(field_object, "field", GROUSER_FIELD_CAPSULE);
    if (!ground.field) return NULL;
    if (ground.field->parameters != parameters)
      return PyErr_Format(PyExc_ValueError, "the field must have %d parameters, got %d", parameters,
                          ground.field->parameters);
  } else if (grouser_copy_doubles(theta_object, "theta", 2 * parameters, theta) < 0) {
    return NULL;
  } else {
    for (int side = 0; side < 2; side++)
      memcpy(ground.theta[side], theta + side * parameters, sizeof(double) * (size_t)parameters);
  }
  ground.parameters = parameters;
  self->without_ground -= self->grounds[vehicle].parameters == 0;
  self->grounds[vehicle] = ground;
  PyObject *former = self->fields[vehicle];
  self->fields[vehicle] = field_object == Py_None ? NULL : Py_NewRef(field_object);
  Py_XDECREF(former);
  return Py_NewRef(Py_None);
}

static PyObject *fleet_advance(PyObject *object, PyObject *const *arguments, Py_ssize_t count) {
  fleet_object *self = (fleet_object *)object;
  if (count != 2) return PyErr_Format(PyExc_TypeError, "advance takes commands and ticks, got %zd arguments", count);
  const long ticks = PyLong_AsLong(arguments[1]);
  if (ticks == -1 && PyErr_Occurred()) return NULL;
  if (ticks < 1 || ticks > INT_MAX)
    return PyErr_Format(PyExc_ValueError, "ticks must lie in [1, %d], got %ld", INT_MAX, ticks);
  if (!is_idle(self)) return NULL;
  if (self->without_ground)
    return PyErr_Format(PyExc_ValueError, "%d vehicles have no ground yet: see set_ground", self->without_ground);
  grouser_array commands;
  if (grouser_array_acquire(arguments[0], "commands", 2, 0, &commands) < 0) return NULL;
  const Py_buffer *views[] = {&self->state.view, &self->memory.view, &self->record.view, &self->status};
  int good = commands.rows == self->fleet.vehicles;
  if (!good)
    PyErr_Format(PyExc_ValueError, "commands must hold a pair for each of %d vehicles, got %zd", self->fleet.vehicles,
                 commands.rows);
  for (int n = 0; good && n < 4; n++)
    if (overlap(&commands.view, views[n])) {
      PyErr_SetString(PyExc_ValueError, "commands must not overlap the fleet's own arrays in memory");
      good = 0;
    }
  if (good) {
    self->advancing = 1;
    Py_BEGIN_ALLOW_THREADS
    grouser_fleet_advance(&self->fleet, commands.data, (int)ticks, &self->pool);
    Py_END_ALLOW_THREADS
    self->advancing = 0;
  }
  grouser_array_release(&commands);
  return good ? Py_NewRef(Py_None) : NULL;
}

static PyObject *fleet_capsule(PyObject *self, void *unused) {
  (void)unused;
  return PyCapsule_New(&((fleet_object *)self)->hold, GROUSER_FLEET_CAPSULE, NULL);
}

static PyGetSetDef fleet_attributes[] = {
    {"fleet", fleet_capsule, NULL, "The compiled fleet itself, alive as long as this object.", NULL},
    {NULL, NULL, NULL, NULL, NULL}};

static PyMethodDef fleet_methods[] = {
    {"set_ground", fleet_set_ground, METH_VARARGS,
     "set_ground(vehicle, theta, slope_x, slope_y[, field]): theta of the left track, then the right; a field replaces it."},
    {"set_traits", fleet_set_traits, METH_VARARGS,
     "set_traits(vehicle, yaw_inertia, belt_time_constant, belt_acceleration): in place of those of the whole fleet."},
    {"advance", (PyCFunction)(void (*)(void))fleet_advance, METH_FASTCALL,
     "advance(commands, ticks): move every vehicle that is not lost, under the belt speeds (left, right) of its row."},
    {NULL, NULL, 0, NULL}};

static PyType_Slot fleet_slots[] = {{Py_tp_new, fleet_new},
                                    {Py_tp_dealloc, fleet_dealloc},
                                    {Py_tp_methods, fleet_methods},
                                   {Py_tp_getset, fleet_attributes},
                                    {Py_tp_doc, "Vehicles of one kind in the caller's arrays, tick by tick, on several threads."},
                                    {0, NULL}};

static PyType_Spec fleet_spec = {"grouser.native._core.Fleet", sizeof(fleet_object), 0, Py_TPFLAGS_DEFAULT, fleet_slots};

int grouser_add_fleet_type(PyObject *module) {
  PyObject *type = PyType_FromSpec(&fleet_spec);
  if (!type) return -1;
  const int status = PyModule_AddObjectRef(module, "Fleet", type);
  Py_DECREF(type);
  return status;
}
