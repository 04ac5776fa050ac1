#include <math.h>
#include <string.h>

#include "grouser/mlp.h"
#include "module.h"

typedef struct {
  PyObject_HEAD
  grouser_mlp net;
  float *parameters; /* every layer's weights, then its biases */
} mlp_object;

/* Copies `count` float64 values of an array into `out`. */
static int copy_doubles(PyObject *object, const char *name, Py_ssize_t count, double *out) {
  grouser_array array;
  if (grouser_array_acquire(object, name, count, 0, &array) < 0) return -1;
  const int fits = array.rows == 1;
  if (fits)
    memcpy(out, array.data, sizeof(double) * (size_t)count);
  else
    PyErr_Format(PyExc_ValueError, "%s must hold %zd values", name, count);
  grouser_array_release(&array);
  return fits ? 0 : -1;
}

static int read_widths(PyObject *widths, grouser_mlp *net) {
  const Py_ssize_t count = PySequence_Size(widths);
  if (count < 0) return -1;
  if (count < 2 || count > GROUSER_MAX_LAYERS + 1) {
    PyErr_Format(PyExc_ValueError, "a network has 1 to %d layers, got %zd", GROUSER_MAX_LAYERS, count - 1);
    return -1;
  }
  net->layers = (int)count - 1;
  for (Py_ssize_t i = 0; i < count; i++) {
    PyObject *item = PySequence_GetItem(widths, i);
    if (!item) return -1;
    const long width = PyLong_AsLong(item);
    Py_DECREF(item);
    if (width == -1 && PyErr_Occurred()) return -1;
    if (width < 1 || width > GROUSER_MAX_WIDTH) {
      PyErr_Format(PyExc_ValueError, "layer widths must lie in [1, %d], got %ld", GROUSER_MAX_WIDTH, width);
      return -1;
    }
    net->widths[i] = (int)width;
  }
  if (net->widths[0] > GROUSER_MAX_COLUMNS || net->widths[net->layers] != GROUSER_OUTPUTS) {
    PyErr_Format(PyExc_ValueError, "a network takes at most %d inputs and returns %d outputs", GROUSER_MAX_COLUMNS,
                 GROUSER_OUTPUTS);
    return -1;
  }
  return 0;
}

/* Copies the packed float32 parameters and points every layer into the copy. */
static float *pack_parameters(PyObject *bytes, grouser_mlp *net) {
  size_t count = 0;
  for (int layer = 0; layer < net->layers; layer++)
    count += (size_t)(net->widths[layer] + 1) * (size_t)net->widths[layer + 1];
  char *data;
  Py_ssize_t length;
  if (PyBytes_AsStringAndSize(bytes, &data, &length) < 0) return NULL;
  if ((size_t)length != count * sizeof(float)) {
    PyErr_Format(PyExc_ValueError, "these layers need %zd bytes of float32 parameters, got %zd",
                 (Py_ssize_t)(count * sizeof(float)), length);
    return NULL;
  }
  float *parameters = PyMem_Malloc((size_t)length);
  if (!parameters) {
    PyErr_NoMemory();
    return NULL;
  }
  memcpy(parameters, data, (size_t)length);
  float *next = parameters;
  for (int layer = 0; layer < net->layers; layer++) {
    net->weights[layer] = next;
    next += (size_t)net->widths[layer] * (size_t)net->widths[layer + 1];
    net->biases[layer] = next;
    next += net->widths[layer + 1];
  }
  return parameters;
}

static PyObject *mlp_new(PyTypeObject *type, PyObject *arguments, PyObject *keywords) {
  static char *names[] = {"activation",  "widths",      "parameters",   "input_mean",
                          "input_scale", "output_mean", "output_scale", NULL};
  int activation;
  PyObject *widths, *bytes, *input_mean, *input_scale, *output_mean, *output_scale;
  if (!PyArg_ParseTupleAndKeywords(arguments, keywords, "iOOOOOO", names, &activation, &widths, &bytes, &input_mean,
                                   &input_scale, &output_mean, &output_scale))
    return NULL;
  if (activation < GROUSER_RELU || activation > GROUSER_TANH) {
    PyErr_SetString(PyExc_ValueError, "activation must be 0 (relu), 1 (silu) or 2 (tanh)");
    return NULL;
  }
  grouser_mlp net;
  memset(&net, 0, sizeof net);
  net.activation = (enum grouser_activation)activation;
  if (read_widths(widths, &net) < 0 || copy_doubles(input_mean, "input_mean", net.widths[0], net.input_mean) < 0 ||
      copy_doubles(input_scale, "input_scale", net.widths[0], net.input_scale) < 0 ||
      copy_doubles(output_mean, "output_mean", GROUSER_OUTPUTS, net.output_mean) < 0 ||
      copy_doubles(output_scale, "output_scale", GROUSER_OUTPUTS, net.output_scale) < 0)
    return NULL;
  float *parameters = pack_parameters(bytes, &net);
  if (!parameters) return NULL;
  allocfunc allocate = (allocfunc)PyType_GetSlot(type, Py_tp_alloc);
  mlp_object *self = (mlp_object *)allocate(type, 0);
  if (!self) {
    PyMem_Free(parameters);
    return NULL;
  }
  self->net = net;
  self->parameters = parameters;
  return (PyObject *)self;
}

static void mlp_dealloc(PyObject *self) {
  PyTypeObject *type = Py_TYPE(self);
  PyMem_Free(((mlp_object *)self)->parameters);
  freefunc release = (freefunc)PyType_GetSlot(type, Py_tp_free);
  release(self);
  Py_DECREF(type);
}

static void evaluate(const void *net, const double *x, double *forces, double *jacobian) {
  grouser_mlp_forces(net, x, forces, jacobian);
}

static const char *refuses(const void *self, const double *x) {
  static const char *const rigid[] = {GROUSER_RIGID_COLUMNS}, *const soil[] = {GROUSER_SOIL_COLUMNS};
  const int inputs = ((const grouser_mlp *)self)->widths[0];
  for (int n = 0; n < inputs; n++)
    if (!isfinite(x[n])) return inputs == grouser_columns(GROUSER_RIGID) ? rigid[n] : soil[n];
  return NULL;
}

static grouser_kernel kernel_of(PyObject *self) {
  const grouser_mlp *net = &((mlp_object *)self)->net;
  return (grouser_kernel){net, net->widths[0], evaluate, refuses};
}

static PyObject *mlp_forces(PyObject *self, PyObject *arguments) {
  PyObject *x, *forces;
  if (!PyArg_ParseTuple(arguments, "OO:forces", &x, &forces)) return NULL;
  const grouser_kernel kernel = kernel_of(self);
  return grouser_kernel_call(&kernel, x, forces, NULL);
}

static PyObject *mlp_forces_and_jacobian(PyObject *self, PyObject *arguments) {
  PyObject *x, *forces, *jacobian;
  if (!PyArg_ParseTuple(arguments, "OOO:forces_and_jacobian", &x, &forces, &jacobian)) return NULL;
  const grouser_kernel kernel = kernel_of(self);
  return grouser_kernel_call(&kernel, x, forces, jacobian);
}

static PyMethodDef mlp_methods[] = {
    {"forces", mlp_forces, METH_VARARGS, "forces(x, forces): write the network's forces of every row."},
    {"forces_and_jacobian", mlp_forces_and_jacobian, METH_VARARGS,
     "forces_and_jacobian(x, forces, jacobian): write forces and their derivatives by every column."},
    {NULL, NULL, 0, NULL}};

static PyType_Slot mlp_slots[] = {{Py_tp_new, mlp_new},
                                  {Py_tp_dealloc, mlp_dealloc},
                                  {Py_tp_methods, mlp_methods},
                                  {Py_tp_doc, "A dense float32 network between float64 interface columns and forces."},
                                  {0, NULL}};

static PyType_Spec mlp_spec = {"grouser.native._core.Mlp", sizeof(mlp_object), 0, Py_TPFLAGS_DEFAULT, mlp_slots};

int grouser_add_mlp_type(PyObject *module) {
  PyObject *type = PyType_FromSpec(&mlp_spec);
  if (!type) return -1;
  const int status = PyModule_AddObjectRef(module, "Mlp", type);
  Py_DECREF(type);
  return status;
}
